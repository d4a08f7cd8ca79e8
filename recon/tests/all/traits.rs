//! Traits of plants that are known in closed form, and laws of all others.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::common::{cases, flat, random_plant, species};
use demeter_frame::Pose;
use demeter_recon::fit::OrganFit;
use demeter_recon::model::leaf::{Blade, COLUMNS, ROWS, node};
use demeter_recon::model::{Form, Joint, Organ, Plant, Species};
use demeter_recon::organs::ScaleSource;
use demeter_recon::traits::{PlantTraits, Sigma, Sigmas, Traits, Unit, keys};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

fn stem(parent: Option<usize>, d: f64, tilt: f64, scale: f64, radius: f64) -> Organ {
    let joint = Joint { d, rotation: DQuat::from_rotation_x(tilt), scale };
    Organ { parent, joint, form: Form::Stem { gamma: vec![], radius } }
}

fn blade(parent: usize, d: f64, tilt: f64, scale: f64, leaf: u16) -> Organ {
    let joint = Joint { d, rotation: DQuat::from_rotation_x(tilt), scale };
    let blade = Blade { beta: vec![], gamma: vec![], width: 1.0 };
    Organ { parent: Some(parent), joint, form: Form::Leaf { blade, leaf } }
}

/// Area of the flat outline by the shoelace formula.
fn flat_area(species: &Species) -> f64 {
    let flat = species.leaf.flat(&[], 1.0);
    let left = (0..ROWS).map(|i| flat[node(i, 0)]);
    let right = (0..ROWS).rev().map(|i| flat[node(i, COLUMNS - 1)]);
    let outline: Vec<DVec2> = left.chain(right).collect();
    let twice: f64 = (0..outline.len()).map(|i| outline[i].perp_dot(outline[(i + 1) % outline.len()])).sum();
    twice.abs() / 2.0
}

fn check(traits: &Traits, key: &str, expected: f64, unit: Unit) {
    let found = traits.get(key).unwrap_or_else(|| panic!("{key} is missing"));
    assert!((found.value - expected).abs() < 1e-6 * expected.abs().max(1.0), "{key}: {found:?}, expected {expected}");
    assert_eq!((found.unit, found.sigma), (unit, None), "{key}");
}

/// An upright stem of 0.5 m with a trifoliate leaf at 0.4 on a petiole at 40 degrees and a simple leaf at 0.8, all
/// straight and flat and turned about the x axis alone. The petiole is 0.1 m to the lateral leaflets and 0.02 m on.
fn example() -> Plant {
    let main = stem(None, 0.0, FRAC_PI_2, 0.5, 0.01);
    let petiole = stem(Some(0), 0.4, -40_f64.to_radians(), 0.24, 0.02);
    let lateral = |tilt: f64| blade(1, 0.1 / 0.12, tilt.to_radians(), 0.5, 0);
    let organs = vec![
        main,
        petiole,
        lateral(-60.0),
        lateral(30.0),
        blade(1, 1.0, -60_f64.to_radians(), 0.75, 0),
        blade(0, 0.8, -PI / 2.0, 0.2, 1),
    ];
    Plant { world_from_plant: Pose::new(DQuat::IDENTITY, DVec3::new(3.0, -2.0, 0.25)), organs }
}

#[test]
fn a_plant_in_closed_form_has_its_traits() {
    let species = flat("soybean");
    let traits = PlantTraits::of(&example(), &species, ScaleSource::Input).unwrap();
    let flat = species.leaf.flat(&[], 1.0);
    let width = (0..ROWS).map(|i| flat[node(i, COLUMNS - 1)].x - flat[node(i, 0)].x).fold(0.0, f64::max);
    let area = flat_area(&species);
    let degrees = f64::to_radians;

    let terminal = &traits.organs[4];
    check(terminal, keys::LEAF_LENGTH, 0.09, Unit::Metre);
    check(terminal, keys::LEAF_WIDTH, 0.09 * width, Unit::Metre);
    check(terminal, keys::LEAF_AREA, 0.09 * 0.09 * area, Unit::SquareMetre);
    // 90 - 40 - 60: the blade points along +y and hangs by 10 degrees.
    check(terminal, keys::LEAF_INCLINATION, degrees(10.0), Unit::Radian);
    check(terminal, keys::LEAF_AZIMUTH, FRAC_PI_2, Unit::Radian);
    check(terminal, keys::LEAF_INSERTION_ANGLE, degrees(60.0), Unit::Radian);
    check(terminal, keys::LEAF_CURVATURE, 0.0, Unit::PerMetre);
    check(terminal, keys::BRANCH_ORDER, 2.0, Unit::One);
    assert!(!terminal.contains_key(keys::INTERNODE_LENGTH), "a rachis has no internodes");
    // 90 - 40 + 30: its tip is 10 degrees short of upright, so its normal is 80 degrees off the vertical.
    check(&traits.organs[3], keys::LEAF_INCLINATION, degrees(80.0), Unit::Radian);

    let petiole = &traits.organs[1];
    check(petiole, keys::PETIOLE_LENGTH, 0.1, Unit::Metre);
    check(petiole, keys::PETIOLE_ANGLE, degrees(40.0), Unit::Radian);
    check(petiole, keys::STEM_LENGTH, 0.12, Unit::Metre);
    check(petiole, keys::STEM_DIAMETER, 2.0 * 0.02 * 0.12, Unit::Metre);
    check(petiole, keys::INTERNODE_LENGTH, 0.2, Unit::Metre);
    check(petiole, keys::BRANCH_ORDER, 1.0, Unit::One);
    check(&traits.organs[5], keys::INTERNODE_LENGTH, 0.2, Unit::Metre);
    check(&traits.organs[5], keys::LEAF_INSERTION_ANGLE, FRAC_PI_2, Unit::Radian);

    let sizes = [0.06, 0.06, 0.09, 0.1];
    let total: f64 = sizes.iter().map(|s| s * s).sum::<f64>() * area;
    let whole = &traits.plant;
    check(whole, keys::HEIGHT, 0.5, Unit::Metre);
    check(whole, keys::LEAF_COUNT, 2.0, Unit::One);
    check(whole, keys::BLADE_COUNT, 4.0, Unit::One);
    check(whole, keys::LEAF_AREA, total, Unit::SquareMetre);
    let lengths = [0.06, 0.06, 0.09, 0.1];
    check(whole, keys::LEAF_LENGTH, lengths.iter().sum::<f64>() / 4.0, Unit::Metre);
    let weighted = (0.06 * 0.06 * (10.0 + 80.0) + 0.09 * 0.09 * 10.0) * area / total;
    check(whole, keys::LEAF_INCLINATION, degrees(weighted), Unit::Radian);
    check(whole, keys::STEM_LENGTH, 0.5, Unit::Metre);
    check(whole, keys::STEM_DIAMETER, 0.01, Unit::Metre);
    check(whole, keys::STEM_LEAN, 0.0, Unit::Radian);
    check(whole, keys::INTERNODE_LENGTH, 0.2, Unit::Metre);
}

#[test]
fn the_shadow_of_a_flat_blade_is_its_area_and_overlap_counts_once() {
    let species = flat("soybean");
    let shadow = |blades: Vec<Organ>| {
        let organs = [vec![stem(None, 0.0, FRAC_PI_2, 0.3, 1e-6)], blades].concat();
        let plant = Plant { world_from_plant: Pose::IDENTITY, organs };
        PlantTraits::of(&plant, &species, ScaleSource::Input).unwrap().plant[keys::PROJECTED_AREA].value
    };
    let level = |d: f64| blade(0, d, -FRAC_PI_2, 0.5, 0);
    let expected = 0.15 * 0.15 * flat_area(&species);
    let one = shadow(vec![level(0.5)]);
    assert!((one / expected - 1.0).abs() < 0.01, "{one}, expected {expected}");
    let two = shadow(vec![level(0.5), level(0.9)]);
    assert!((two / expected - 1.0).abs() < 0.01, "{two}, expected {expected}");
    let tilted = shadow(vec![blade(0, 0.5, -FRAC_PI_2 + 1.0, 0.5, 0)]);
    assert!((tilted / expected - 1.0_f64.cos()).abs() < 0.01, "{tilted}");
}

#[test]
fn without_a_scale_metres_are_withheld() {
    let traits = PlantTraits::of(&example(), &species("soybean"), ScaleSource::None).unwrap();
    let all: Vec<&Traits> = traits.organs.iter().chain([&traits.plant]).collect();
    assert!(all.iter().flat_map(|t| t.values()).all(|q| matches!(q.unit, Unit::Radian | Unit::One)));
    assert!(traits.plant.contains_key(keys::LEAF_COUNT) && traits.plant.contains_key(keys::LEAF_INCLINATION));
}

proptest! {
    #![proptest_config(cases(24))]

    /// Moving and turning about the vertical changes azimuths alone; growing changes each trait by its unit.
    #[test]
    fn traits_follow_their_units(
        name in prop::sample::select(vec!["soybean", "maize"]),
        organs in 1..15_usize,
        seed in any::<u64>(),
        yaw in -3.0..3.0_f64,
        grown in 0.2..3.0_f64,
    ) {
        let species = species(name);
        let plant = random_plant(&species, organs, seed);
        let mut other = plant.clone();
        other.world_from_plant = Pose::new(DQuat::from_rotation_z(yaw), DVec3::new(1.0, 2.0, 3.0)).then(&plant.world_from_plant);
        other.organs[0].joint.scale *= grown;
        let [a, b] = [&plant, &other].map(|p| PlantTraits::of(p, &species, ScaleSource::Input).unwrap());
        for (a, b) in a.organs.iter().chain([&a.plant]).zip(b.organs.iter().chain([&b.plant])) {
            prop_assert!(a.keys().eq(b.keys()));
            for ((key, a), b) in a.iter().zip(b.values()) {
                prop_assert!(a.value.is_finite());
                if key == keys::LEAF_AZIMUTH {
                    prop_assert!((DQuat::from_rotation_z(b.value - a.value - yaw).w.abs() - 1.0).abs() < 1e-9);
                    continue;
                }
                let factor = match a.unit {
                    Unit::Metre => grown,
                    Unit::SquareMetre => grown.powi(2),
                    Unit::CubicMetre => grown.powi(3),
                    Unit::PerMetre => 1.0 / grown,
                    Unit::Radian | Unit::One => 1.0,
                };
                // A turned raster covers other cells.
                let tolerance = if key == keys::PROJECTED_AREA { 0.03 } else { 1e-6 };
                prop_assert!((b.value - a.value * factor).abs() <= tolerance * b.value.abs().max(1e-9), "{key}: {a:?} {b:?}");
            }
        }
    }
}

#[test]
fn what_the_fit_knows_reaches_blades_and_the_plant() {
    let species = species("soybean");
    let organs = vec![stem(None, 0.0, 0.0, 0.5, 0.004), blade(0, 0.5, 1.0, 0.2, 0), blade(0, 1.0, 0.5, 0.3, 1)];
    let plant = Plant { world_from_plant: Pose::IDENTITY, organs };
    let fit = |visible_fraction: Option<f64>, sigmas: Sigmas| OrganFit {
        source: None,
        points: 9,
        residual: None,
        visible_fraction,
        converged: true,
        sigmas,
    };
    let sure = |metres: f64| Sigmas::from([(keys::LEAF_LENGTH, Sigma { data: metres, model: 0.0 })]);
    let fits = [fit(None, Sigmas::new()), fit(Some(0.9), sure(0.003)), fit(Some(0.2), sure(0.004))];
    let mut traits = PlantTraits::of(&plant, &species, ScaleSource::Input).unwrap();
    assert_eq!(traits.plant.get(keys::BLADE_COUNT_VISIBLE), None);
    traits.take_up(&fits);
    check(&traits.plant, keys::BLADE_COUNT_VISIBLE, 1.0, Unit::One);
    assert_eq!(traits.organs[1][keys::LEAF_LENGTH].sigma, Some(0.003));
    let of_mean = traits.plant[keys::LEAF_LENGTH].sigma.unwrap();
    assert!((of_mean - 0.0025).abs() < 1e-12, "{of_mean}");
    // Nothing is known of areas here, and nothing is made up.
    assert_eq!((traits.organs[1][keys::LEAF_AREA].sigma, traits.plant[keys::LEAF_AREA].sigma), (None, None));
}
