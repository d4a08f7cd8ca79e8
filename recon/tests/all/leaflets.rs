//! Leaflets whose petiole was not seen make one leaf when they start together, and leaves of their own when not.

use std::collections::BTreeSet;

use demeter_recon::model::{Form, OrganKind};
use demeter_recon::organs::{OrganCloud, OrganTree};
use demeter_recon::{fit, species};
use glam::DVec3;

fn cloud(kind: OrganKind, points: Vec<DVec3>) -> OrganCloud {
    OrganCloud { kind, source: (0..points.len() as u32).collect(), points }
}

/// An oval sheet 6 cm long from `foot` along `direction`.
fn leaflet(foot: DVec3, direction: DVec3) -> OrganCloud {
    let across = direction.cross(DVec3::Z).normalize();
    let at = |i: i32, j: i32| {
        let (v, u) = (f64::from(i) / 24.0, f64::from(j) / 8.0 - 1.0);
        foot + direction * (0.06 * v) + across * (0.03 * u * (v * (1.0 - v)).sqrt())
    };
    cloud(OrganKind::Leaf, (0..25).flat_map(|i| (0..17).map(move |j| (i, j))).map(|(i, j)| at(i, j)).collect())
}

/// Leaves and stems of a plant with three leaflets that start `spread` metres from where a petiole would end.
fn counts(name: &str, spread: f64) -> (usize, usize) {
    let stem = (0..100).map(|i| DVec3::new(0.0, 0.0, 0.004 * f64::from(i))).collect();
    let end = DVec3::new(0.15, 0.0, 0.3);
    let directions = [DVec3::X, DVec3::new(0.3, 1.0, 0.0).normalize(), DVec3::new(0.3, -1.0, 0.0).normalize()];
    let mut organs = vec![cloud(OrganKind::MainStem, stem)];
    organs.extend(directions.map(|direction| leaflet(end + direction * spread, direction)));
    let tree = OrganTree { organs, parent: vec![None, Some(0), Some(0), Some(0)] };
    let plant = fit::plant(&tree, &species::shipped(name).unwrap().unwrap(), DVec3::Z).unwrap().plant;
    let leaves: BTreeSet<u16> = plant
        .organs
        .iter()
        .filter_map(|organ| match organ.form {
            Form::Leaf { leaf, .. } => Some(leaf),
            Form::Stem { .. } => None,
        })
        .collect();
    (leaves.len(), plant.organs.iter().filter(|organ| organ.kind() == OrganKind::Stem).count())
}

#[test]
fn leaflets_that_start_together_share_a_petiole() {
    assert_eq!(counts("soybean", 0.001), (1, 3), "one leaf on one petiole with two petiolules");
    assert_eq!(counts("soybean", 0.012), (1, 3));
    assert_eq!(counts("soybean", 0.2).0, 3, "far apart: three leaves");
    assert_eq!(counts("tobacco", 0.001), (3, 3), "leaves of simple-leaved plants never share a petiole");
}
