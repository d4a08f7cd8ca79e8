//! The shipped network over points computes in Rust, pyramid and all, what it computed in Python.
#![allow(clippy::unwrap_used, missing_docs)]

use std::num::NonZeroUsize;

use demeter_frame::PointMaps;
use demeter_models::{Organ3d, Runtime, find_manifest};
use demeter_recon::pyramid;
use glam::DVec3;
use serde_json::Value;

/// Largest difference allowed between ONNX Runtime here and PyTorch there, both in single precision, of probabilities
/// and of the truncated inverse distance: sums of some hundred terms over forty layers, in another order.
const TOLERANCE: f64 = 1e-3;

/// `pinned_points` of models/training/export3d.py.
fn points(count: usize) -> Vec<DVec3> {
    let place = |i: usize| {
        let square = (i * i) as f64;
        let fraction = |k: f64| (square * k) % 1.0;
        DVec3::new(
            fraction(0.618_033_988_749_895),
            fraction(0.754_877_666_246_692_7),
            fraction(0.569_840_290_998_053_2),
        )
    };
    (0..count).map(place).collect()
}

fn network() -> Organ3d {
    Organ3d::open(&Runtime::load(None).unwrap(), &find_manifest("organ3d").unwrap(), NonZeroUsize::MIN).unwrap()
}

/// For each pin the largest difference from what was found.
fn differences(maps: &PointMaps, pins: &[Value]) -> Vec<f64> {
    let largest = |pin: &Value| {
        let i = pin["at"].as_u64().unwrap() as usize;
        let pinned = |key: &str, k: usize| pin[key][k].as_f64().unwrap();
        let logits = [0, 1, 2].map(|k| pinned("semantic", k).exp());
        let of_class = |k: usize| logits[k] / logits.iter().sum::<f64>() - f64::from(maps.probabilities[i][k]);
        let of_boundary = pinned("boundary", 0) - f64::from(maps.boundary[i]);
        [of_class(0), of_class(1), of_class(2), of_boundary].map(f64::abs).into_iter().fold(0.0, f64::max)
    };
    pins.iter().map(largest).collect()
}

#[test]
fn answers_are_those_that_python_pinned_and_a_moved_point_is_noticed() {
    let path = find_manifest("organ3d").unwrap().with_file_name("organ3d.pins.json");
    let pinned: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let pins = pinned["pins"].as_array().unwrap();
    let mut points = points(pinned["points"].as_u64().unwrap() as usize);
    let found = differences(&network().run(&pyramid::of(&points).unwrap()).unwrap(), pins);
    let largest = found.iter().copied().fold(0.0, f64::max);
    assert!(pins.len() >= 50 && largest <= TOLERANCE, "{} pins, largest difference {largest:e}", pins.len());
    // The negative control: with the cloud a tenth taller most pins must fail.
    points.iter_mut().for_each(|p| p.z *= 1.1);
    let moved = differences(&network().run(&pyramid::of(&points).unwrap()).unwrap(), pins);
    assert!(moved.iter().filter(|difference| **difference > TOLERANCE).count() * 2 > pins.len());
}

#[test]
fn any_cloud_gets_an_answer_twice_the_same() {
    for count in [1, 2, 40, 3000] {
        let pyramid = pyramid::of(&points(count)).unwrap();
        let maps = network().run(&pyramid).unwrap();
        assert_eq!((maps.probabilities.len(), maps.boundary.len()), (count, count));
        assert!(maps.boundary.iter().all(|t| (0.0..=1.0).contains(t)));
        assert_eq!(maps, network().run(&pyramid).unwrap());
    }
}

/// Without ONNX Runtime geometry finds the organs, and the answer says so; with it, nothing is to be said.
#[test]
fn without_the_library_geometry_stands_in_and_a_warning_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let grown = ["synth", "clouds", "--species", "soybean", "--count", "1", "-o", &at("clouds")];
    assert!(demeter_tests::demeter().args(grown).status().unwrap().success());
    let cloud = std::fs::read_dir(at("clouds")).unwrap().map(|file| file.unwrap().path());
    let cloud = cloud.filter(|path| path.extension().is_some_and(|end| end == "ply")).min().unwrap();
    let fit = |library: &str| {
        let output = demeter_tests::demeter()
            .args(["fit", cloud.to_str().unwrap(), "--species", "soybean", "--labels", "none", "--json"])
            .args(["-o", &at("plant.dmtr")])
            .env("DEMETER_ONNXRUNTIME", library)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(answer["plants"].as_array().unwrap().len(), 1);
        answer["warnings"].to_string()
    };
    assert!(fit("/nowhere/libonnxruntime.so").contains("organs were found by geometry alone"));
    assert!(!fit("").contains("geometry"));
}
