//! Organs of points: a graph of known answers, and the shipped network against what Python pinned is in
//! tests/tests/organ3d.rs, because its pyramid comes from demeter-recon.
#![allow(clippy::unwrap_used, missing_docs)]

mod installed;

use demeter_frame::{PointPyramid, PyramidLevel};
use demeter_models::{Layout, ModelError, Organ2d, Organ3d};
use installed::{ONE, installed, runtime};

/// Three points, all of them on every level.
fn cloud() -> PointPyramid {
    let points = vec![[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 500.0]];
    let level = PyramidLevel {
        points: points.clone(),
        below: vec![[0; 16]; 3],
        beside: vec![[0; 16]; 3],
        parent: vec![0, 1, 2],
    };
    let local = [0.0, 0.25, 1.0].map(|planarity| [0.5, planarity, 0.5, 0.5, 0.5, 0.01]).to_vec();
    let levels = [level.clone(), level.clone(), level];
    PointPyramid { up: vec![[2; 3], [1; 3], [0; 3]], finest: points.clone(), points, levels, local }
}

fn run(fixture: &str, cloud: &PointPyramid) -> Result<demeter_frame::PointMaps, ModelError> {
    let (_folder, path) = installed(fixture, Some(Layout::Organ3d));
    Organ3d::open(&runtime(), &path, ONE)?.run(cloud)
}

#[test]
fn answers_stay_with_their_points() {
    let maps = run("organ3d", &cloud()).unwrap();
    assert_eq!(maps.boundary, [1.0, 0.5, 0.0]);
    for (class, p) in maps.probabilities.iter().enumerate() {
        assert!((p.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{p:?}");
        assert!(p.iter().enumerate().all(|(other, x)| other == class || *x < p[class]), "{p:?}");
    }
    // The softmax of 3, 0, 0; and logits far apart that must not overflow.
    assert!((maps.probabilities[0][0] - 3f32.exp() / (3f32.exp() + 2.0)).abs() < 1e-6);
    assert_eq!(maps.probabilities[2], [0.0, 0.0, 1.0]);
    assert_eq!(maps, run("organ3d", &cloud()).unwrap());
}

#[test]
fn outputs_that_are_no_numbers_or_for_other_points_are_errors() {
    let error = run("organ3d_nan", &cloud()).unwrap_err();
    assert!(matches!(&error, ModelError::NotFinite { output, .. } if output == "boundary"), "{error}");
    let mut more = cloud();
    more.points.push([0.0; 3]);
    more.up.push([0; 3]);
    let error = run("organ3d_misshaped", &more).unwrap_err();
    let ModelError::Shape { output, expected, found, .. } = error else { panic!("{error}") };
    assert_eq!((output.as_str(), expected, found), ("semantic", vec![4, 3], vec![3, 3]));
}

#[test]
fn indices_that_point_nowhere_are_errors() {
    for index in [3, -4, i64::MAX] {
        let mut bad = cloud();
        bad.up[1] = [index; 3];
        assert!(matches!(run("organ3d", &bad), Err(ModelError::Session { .. })), "{index}");
    }
}

#[test]
fn networks_of_other_ports_or_another_layout_are_refused() {
    let (_folder, path) = installed("organ3d", Some(Layout::Organ3d));
    assert!(matches!(Organ2d::open(&runtime(), &path, ONE), Err(ModelError::Ports { .. })));
    let (_folder, path) = installed("depth_anything", None);
    assert!(matches!(Organ3d::open(&runtime(), &path, ONE), Err(ModelError::Ports { .. })));
    let (_folder, path) = installed("unknown", Some(Layout::Organ3d));
    let error = Organ3d::open(&runtime(), &path, ONE).unwrap_err().to_string();
    assert!(error.contains("beside3 i64[-1, 16]") && error.contains("input f32[1, 3, 224, 224]"), "{error}");
}
