//! `demeter learn shape` and its grids on real leaf scans.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use demeter_recon::learn::{Ends, Outline, folded, harmonic};
use demeter_recon::model::Species;
use demeter_recon::model::leaf::{ROWS, node};
use demeter_tests::{demeter, shared};
use glam::DVec2;
use image::ImageReader;
use image::imageops::{FilterType, resize};
use serde_json::Value;

/// The pictures of a folder in the order of their names.
fn pictures(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    found
}

#[test]
fn lobed_silhouettes_have_grids_without_a_folded_cell() {
    let Some(folder) = shared("lobed_silhouettes", "data/leaf-silhouettes/SampleImages") else { return };
    let pictures = pictures(&folder);
    assert_eq!(pictures.len(), 35);
    for path in pictures {
        let mask = ImageReader::open(&path).unwrap().decode().unwrap().into_luma8();
        let scale = 512.0 / f64::from(mask.width().max(mask.height()));
        let side = |side: u32| (f64::from(side) * scale) as u32;
        let mask = resize(&mask, side(mask.width()), side(mask.height()), FilterType::Triangle);
        let traced = Outline::trace(&mask, Ends::Auto).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let grid = harmonic(&traced.outline).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert_eq!(folded(&grid), 0, "{}", path.display());
    }
}

#[test]
fn ten_components_foretell_soybean_leaflets_within_half_a_percent() {
    let Some(folder) = shared("soybean_leaflets", "data/soybean-leaflets/mask") else { return };
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("soybean.safetensors");
    // Every third scan: a third of the time, and a harder task than all of them.
    let output = demeter()
        .args(["learn", "shape", "--json", "--from", "soybean", "--base", "top", "-o", file.to_str().unwrap()])
        .args(pictures(&folder).iter().step_by(3))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let error = told["curve"][10]["error"].as_f64().unwrap();
    assert!(error < 0.005, "{error}");
    assert!(told["kept"].as_u64().unwrap() > 40, "{told}");
    let species = Species::from_bytes(&std::fs::read(&file).unwrap()).unwrap();
    assert_eq!(species.hash(), told["hash"]);
    let flat = species.leaf.flat(&[3.0; 10], 1.0);
    assert_eq!([flat[node(0, 9)], flat[node(ROWS - 1, 9)]], [DVec2::ZERO, DVec2::Y]);
}

#[test]
fn a_folder_without_leaves_teaches_nothing() {
    let out = tempfile::tempdir().unwrap();
    image::GrayImage::new(40, 40).save(out.path().join("empty.png")).unwrap();
    std::fs::write(out.path().join("broken.png"), b"no picture").unwrap();
    let file = out.path().join("none.safetensors");
    let output = demeter()
        .args(["learn", "shape", out.path().to_str().unwrap(), "--from", "soybean", "-o", file.to_str().unwrap()])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("empty.png") && said.contains("broken.png"), "{said}");
    assert!(!file.exists());
}
