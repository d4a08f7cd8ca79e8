//! `demeter fit` on real scans: with the labels that come with them and without. What it prints is held to the
//! contract, what it writes is read back.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use demeter_tests::{answer, demeter, recorded, shared};
use serde_json::Value;

/// Fits a cloud and returns its plant.
fn fit(cloud: &Path, more: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("plant.dmtr");
    let mut arguments = vec!["fit", cloud.to_str().unwrap(), "-o", record.to_str().unwrap()];
    arguments.extend(more);
    let (code, fitted) = answer(&arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {fitted}");
    let plant = fitted["plants"][0].clone();
    assert_eq!(plant["bytes"], std::fs::metadata(&record).unwrap().len());
    // The record alone gives the same traits.
    let (code, decoded) = answer(&["decode", record.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{decoded}");
    assert_eq!(recorded(&decoded["plants"][0]["traits"]), recorded(&plant["traits"]));
    eprintln!("{}: CD {}, {} bytes", cloud.display(), plant["cd"], plant["bytes"]);
    plant
}

#[test]
fn the_real_soybean_without_labels() {
    let Some(cloud) = shared("the_real_soybean_without_labels", "data/soybean-clouds/27_o.ply") else { return };
    let plant = fit(&cloud, &["--species", "soybean"]);
    // The authors' SimpleProc scores 0.059 on this cloud; half of it is no plant that this project would show.
    assert!(plant["cd"].as_f64().unwrap() < 0.02, "{}", plant["cd"]);
    let height = plant["traits"]["height"]["value"].as_f64().unwrap();
    assert!((height - 0.72).abs() < 0.05, "the cloud is 0.72 m high, the plant {height}");
}

#[test]
fn one_scan_of_each_species_with_and_without_labels() {
    for (species, file) in [
        ("maize", "maize/maize_control_plant1_D05.ply"),
        ("sorghum", "sorghum/sorghum_control_plant3_D06.ply"),
        ("tobacco", "tobacco/tobacco_heat_plant3_D06.ply"),
        ("tomato", "tomato/tomato1_control1_plant1_D09.ply"),
    ] {
        let test = "one_scan_of_each_species_with_and_without_labels";
        let Some(cloud) = shared(test, &format!("data/organ-clouds/{file}")) else { return };
        for (labels, worst_cd) in [("label", 0.012), ("none", 0.03)] {
            let common = ["--species", species, "--unit", "mm", "--up", "auto", "--labels", labels];
            let plant = fit(&cloud, &common);
            assert!(plant["cd"].as_f64().unwrap() < worst_cd, "{file} {labels}: {}", plant["cd"]);
            assert_eq!(plant["scale_source"], "input");
        }
    }
}

#[test]
fn bad_clouds_end_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("out.dmtr");
    let header = |count: usize| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        )
    };
    let same = header(80) + &"1 2 3\n".repeat(80);
    for (name, content) in [
        ("empty", String::new()),
        ("no_ply", "hello\n".into()),
        ("truncated", header(1_000_000_000)),
        ("three_points", header(3) + "0 0 0\n0 0 1\n0 1 0\n"),
        ("one_place", same),
        ("not_finite", header(1) + "nan 0 0\n"),
    ] {
        let cloud = folder.path().join(format!("{name}.ply"));
        std::fs::write(&cloud, content).unwrap();
        let (code, refused) =
            answer(&["fit", cloud.to_str().unwrap(), "--species", "soybean", "-o", record.to_str().unwrap()]);
        assert_eq!(code, Some(1), "{name}: {refused}");
        let message = refused["error"]["message"].as_str().unwrap();
        assert!(message.contains(&format!("{name}.ply")), "{name}: {message}");
        assert!(!record.exists(), "{name}: nothing is written for a refused cloud");
    }
    let unknown = demeter().args(["fit", "x.ply", "--species", "triffid", "-o", "y"]).output().unwrap();
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("soybean"), "the message lists what there is");
}
