//! An organ that cannot be fitted costs only itself: it is left out with its reason and what it carries hangs on its
//! parent.

use crate::common::species;
use demeter_recon::fit::{self, FitError};
use demeter_recon::model::{Habit, OrganKind, PlantError};
use demeter_recon::organs::{OrganCloud, OrganTree};
use glam::DVec3;

fn line(kind: OrganKind, from: DVec3, to: DVec3, count: u32) -> OrganCloud {
    let points = (0..count).map(|i| from.lerp(to, f64::from(i) / f64::from(count - 1))).collect();
    OrganCloud { kind, points, source: (0..count).collect() }
}

/// A sheet 6 cm long and 3 cm wide that starts at `foot`.
fn sheet(foot: DVec3) -> OrganCloud {
    let at = |i: u32, j: u32| foot + DVec3::new(0.06 * f64::from(i) / 20.0, 0.03 * (f64::from(j) / 10.0 - 0.5), 0.0);
    let points: Vec<DVec3> = (0..=20).flat_map(|i| (0..=10).map(move |j| at(i, j))).collect();
    OrganCloud { kind: OrganKind::Leaf, source: (0..points.len() as u32).collect(), points }
}

/// A main stem; a petiole of two points; a leaf on it; a petiole whose points coincide; a leaf on that.
fn tree() -> OrganTree {
    let (low, high) = (DVec3::new(0.05, 0.0, 0.2), DVec3::new(0.05, 0.0, 0.35));
    let organs = vec![
        line(OrganKind::MainStem, DVec3::ZERO, DVec3::new(0.0, 0.0, 0.4), 80),
        line(OrganKind::Stem, DVec3::new(0.0, 0.0, 0.2), low, 2),
        sheet(low),
        line(OrganKind::Stem, high, high, 30),
        sheet(high),
    ];
    OrganTree { organs, parent: vec![None, Some(0), Some(1), Some(0), Some(3)] }
}

#[test]
fn an_organ_without_points_or_extent_is_left_out_and_its_leaf_is_hung() {
    for name in ["soybean", "maize"] {
        let species = species(name);
        let fitted = fit::plant(&tree(), &species, DVec3::Z).unwrap();
        let [FitError::Points { organ: 1, found: 2, .. }, FitError::Extent { organ: 3, .. }] = &fitted.dropped[..]
        else {
            panic!("{:?}", fitted.dropped);
        };
        let leaves: Vec<usize> = fitted
            .organs
            .iter()
            .zip(&fitted.plant.organs)
            .filter(|(_, o)| o.kind() == OrganKind::Leaf)
            .map(|(f, _)| f.source.unwrap())
            .collect();
        assert_eq!(leaves, [2, 4]);
        // Bridged by petioles where the species has them, else straight on the stem.
        let stems = fitted.plant.organs.iter().filter(|o| o.kind() == OrganKind::Stem).count();
        assert_eq!(stems, if species.habit == Habit::Grass { 0 } else { 2 });
    }
}

#[test]
fn what_hangs_on_a_leaf_is_left_out() {
    let mut tree = tree();
    tree.parent[4] = Some(2);
    let fitted = fit::plant(&tree, &species("soybean"), DVec3::Z).unwrap();
    let reason =
        fitted.dropped.iter().find(|reason| matches!(reason, FitError::Plant(PlantError::LeafParent { organ: 4, .. })));
    assert!(reason.is_some(), "{:?}", fitted.dropped);
}

#[test]
fn without_a_main_stem_there_is_no_plant() {
    let soybean = species("soybean");
    let mut stem_less = tree();
    stem_less.organs[0].points.truncate(2);
    let reason = fit::plant(&stem_less, &soybean, DVec3::Z).unwrap_err();
    assert_eq!(reason, FitError::Points { organ: 0, expected: 3, found: 2 });
    let none = OrganTree { organs: Vec::new(), parent: Vec::new() };
    assert_eq!(fit::plant(&none, &soybean, DVec3::Z), Err(PlantError::Empty.into()));
    let mut upside_down = tree();
    upside_down.parent[1] = Some(2);
    let reason = fit::plant(&upside_down, &soybean, DVec3::Z).unwrap_err();
    assert_eq!(reason, PlantError::Parent { organ: 1, found: 2 }.into());
    let mut two_roots = tree();
    two_roots.parent[3] = None;
    assert!(matches!(
        fit::plant(&two_roots, &soybean, DVec3::Z),
        Err(FitError::Plant(PlantError::MainStem { organ: 3, .. }))
    ));
    assert!(fit::plant(&tree(), &soybean, DVec3::Z).is_ok(), "the negative control");
}
