//! Blades fitted alone: laws that hold for any cloud, and grown blades that come back, with how sure they say they are.

use crate::common::species;
use demeter_recon::fit::{FitError, LoneBlade, lone_blade};
use demeter_recon::metrics::sample_surface;
use demeter_recon::model::leaf::{COLUMNS, ROWS, VEIN, node};
use demeter_recon::model::{Detail, Form, Knots, PlantMesh, PosedPlant, Species, forward};
use demeter_recon::traits::keys;
use demeter_recon::world::{grow, seeded};
use glam::{DQuat, DVec3};
use rand::Rng;

/// A blade as it grew.
struct Grown {
    base: DVec3,
    control: Vec<DVec3>,
    mesh: PlantMesh,
}

fn mesh(control: &[DVec3], of: &PosedPlant) -> PlantMesh {
    let one = PosedPlant {
        world_from_organ: vec![of.world_from_organ[0]],
        control: vec![control.to_vec()],
        radius: vec![0.0],
        side: vec![DVec3::X],
    };
    PlantMesh::of(&one, Detail::Control, Knots::Uniform)
}

/// The first blades of grown plants.
fn grown(species: &Species, plants: std::ops::Range<u64>, each: usize) -> Vec<Grown> {
    let of_plant = |seed: u64| {
        let plant = grow(species, 0.5, &mut seeded(seed));
        let posed = forward(&plant, species).expect("valid");
        let blades = plant.organs.iter().enumerate().filter(|(_, organ)| matches!(organ.form, Form::Leaf { .. }));
        let blades = blades.take(each).map(|(i, _)| Grown {
            base: posed.world_from_organ[i].translation,
            control: posed.control[i].clone(),
            mesh: mesh(&posed.control[i], &posed),
        });
        blades.collect::<Vec<_>>()
    };
    plants.flat_map(of_plant).collect()
}

impl Grown {
    fn points(&self, noise: f64, seed: u64) -> Vec<DVec3> {
        let mut random = seeded(seed);
        let mut spread = || noise * 3_f64.sqrt() * random.random_range(-1.0..1.0);
        let sampled = sample_surface(&self.mesh, 1_500, seed).into_iter();
        sampled.map(|(p, _)| p + DVec3::new(spread(), spread(), spread())).collect()
    }

    fn area(&self) -> f64 {
        area(&self.mesh)
    }
}

fn area(mesh: &PlantMesh) -> f64 {
    (0..mesh.faces.len()).map(|face| mesh.face_area(face)).sum()
}

fn vein(control: &[DVec3]) -> f64 {
    (1..ROWS).map(|i| control[node(i, VEIN)].distance(control[node(i - 1, VEIN)])).sum()
}

/// Area, length of the main vein, control points.
fn measured(found: &LoneBlade, species: &Species) -> (f64, f64, Vec<DVec3>) {
    let posed = found.posed(species);
    let control = posed.control[0].clone();
    (area(&mesh(&control, &posed)), vein(&control), control)
}

fn fitted(points: &[DVec3], base: DVec3, species: &Species) -> LoneBlade {
    lone_blade(points, Some(base), DVec3::Z, species).expect("fits")
}

#[test]
fn turning_moving_and_scaling_the_points_does_the_same_to_the_blade() {
    let species = species("soybean");
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0);
    for blade in grown(&species, 1..4, 1) {
        let points = blade.points(0.0005, 1);
        let moved = |p: DVec3| turn * p * 1.4 + DVec3::new(3.0, -2.0, 1.0);
        let there: Vec<DVec3> = points.iter().map(|p| moved(*p)).collect();
        let one = measured(&fitted(&points, blade.base, &species), &species).2;
        let other = lone_blade(&there, Some(moved(blade.base)), turn * DVec3::Z, &species).expect("fits");
        let other = measured(&other, &species).2;
        // Rounding may tip a point from one node to the next, which moves the end of the fit a little.
        let apart = one.iter().zip(&other).map(|(a, b)| moved(*a).distance(*b)).fold(0.0, f64::max);
        assert!(apart < 0.02 * 1.4 * vein(&blade.control), "{apart}");
    }
}

#[test]
fn the_order_of_few_enough_points_hardly_matters_and_the_same_points_give_the_same_bytes() {
    let species = species("soybean");
    let blade = &grown(&species, 5..6, 1)[0];
    let points = blade.points(0.0005, 1);
    let reversed: Vec<DVec3> = points.iter().rev().copied().collect();
    let one = fitted(&points, blade.base, &species);
    assert_eq!(one, fitted(&points, blade.base, &species));
    let (one, other) = (measured(&one, &species), measured(&fitted(&reversed, blade.base, &species), &species));
    assert!((one.0 / other.0 - 1.0).abs() < 0.03, "areas {} and {}", one.0, other.0);
    assert!((one.1 / other.1 - 1.0).abs() < 0.02, "lengths {} and {}", one.1, other.1);
}

#[test]
fn a_mirrored_blade_is_fitted_as_well() {
    let species = species("soybean");
    for blade in grown(&species, 7..10, 1) {
        let points = blade.points(0.0, 1);
        let mirror = |p: &DVec3| DVec3::new(-p.x, p.y, p.z);
        let mirrored: Vec<DVec3> = points.iter().map(mirror).collect();
        let one = measured(&fitted(&points, blade.base, &species), &species);
        let other = measured(&fitted(&mirrored, mirror(&blade.base), &species), &species);
        assert!((one.0 / other.0 - 1.0).abs() < 0.03, "areas {} and {}", one.0, other.0);
    }
}

#[test]
fn grown_blades_come_back_and_say_how_sure_they_are() {
    for name in ["soybean", "maize"] {
        let species = species(name);
        let (mut misses, mut inside, mut count) = (0.0, 0, 0);
        for (seed, blade) in (1..).zip(grown(&species, 20..30, 2)) {
            let found = fitted(&blade.points(0.001, seed), blade.base, &species);
            let (area, length, _) = measured(&found, &species);
            misses += (area / blade.area() - 1.0).abs();
            let sure = |key: &str, value: f64, truth: f64| {
                let sigma = &found.fit.sigmas[key];
                (value - truth).abs() < 1.96 * sigma.data.hypot(sigma.model * value)
            };
            count += 2;
            inside += usize::from(sure(keys::LEAF_AREA, area, blade.area()));
            inside += usize::from(sure(keys::LEAF_LENGTH, length, vein(&blade.control)));
        }
        let mean = misses / f64::from(count) * 2.0;
        eprintln!("{name}: area MAPE {:.1} %, {inside} of {count} traits within 95 %", 100.0 * mean);
        assert!(mean < 0.06, "{name}: {mean}");
        assert!(inside * 10 >= usize::try_from(count).expect("small") * 8, "{name}: {inside} of {count}");
    }
}

#[test]
fn holes_leave_the_blade_whole_and_make_it_less_sure() {
    let species = species("soybean");
    for blade in grown(&species, 40..44, 1) {
        let points = blade.points(0.0, 3);
        let hole = blade.control[node(22, 8)];
        let holed: Vec<DVec3> =
            points.iter().copied().filter(|p| p.distance(hole) > 0.2 * vein(&blade.control)).collect();
        let (whole, part) = (fitted(&points, blade.base, &species), fitted(&holed, blade.base, &species));
        let area = measured(&part, &species).0;
        assert!((area / blade.area() - 1.0).abs() < 0.15, "{area} of {}", blade.area());
        assert!(part.fit.visible_fraction < whole.fit.visible_fraction, "{:?}", part.fit);
        let of = |found: &LoneBlade| found.fit.sigmas[keys::LEAF_AREA].data;
        assert!(of(&part) > of(&whole), "{} and {}", of(&part), of(&whole));
    }
}

#[test]
fn both_faces_of_a_thick_leaf_make_one_blade_between_them() {
    let species = species("soybean");
    for blade in grown(&species, 50..53, 1) {
        let across = blade.control[node(22, COLUMNS - 1)] - blade.control[node(22, 0)];
        let along = blade.control[node(23, VEIN)] - blade.control[node(21, VEIN)];
        let up = across.cross(along).normalize() * 0.0005;
        let one = blade.points(0.0, 1).into_iter().map(|p| p + up);
        let both: Vec<DVec3> = one.chain(blade.points(0.0, 2).into_iter().map(|p| p - up)).collect();
        let area = measured(&fitted(&both, blade.base, &species), &species).0;
        assert!((area / blade.area() - 1.0).abs() < 0.05, "{area} of {}", blade.area());
    }
}

#[test]
fn noise_makes_a_blade_worse_and_less_sure() {
    // The negative control: an error that does not grow with the data's measures nothing.
    let species = species("soybean");
    let (mut clean, mut noisy) = ((0.0, 0.0), (0.0, 0.0));
    for blade in grown(&species, 60..64, 1) {
        for (noise, sum) in [(0.0, &mut clean), (0.005, &mut noisy)] {
            let found = fitted(&blade.points(noise, 1), blade.base, &species);
            sum.0 += found.fit.residual.expect("has points");
            sum.1 += found.fit.sigmas[keys::LEAF_INCLINATION].data;
        }
    }
    assert!(noisy.0 > 5.0 * clean.0 && noisy.1 > 2.0 * clean.1, "clean {clean:?}, noisy {noisy:?}");
}

#[test]
fn no_blade_comes_out_of_nothing() {
    let species = species("soybean");
    let fit = |points: &[DVec3]| lone_blade(points, None, DVec3::Z, &species);
    assert!(matches!(fit(&[]), Err(FitError::Points { .. })));
    assert!(matches!(fit(&[DVec3::ONE; 100]), Err(FitError::Extent { .. })));
    assert!(matches!(fit(&[DVec3::NAN; 100]), Err(FitError::Extent { .. })));
    // Points on a line are a blade of some kind, but no NaN.
    let line: Vec<DVec3> = (0..50).map(|i| DVec3::X * f64::from(i) * 0.01).collect();
    assert!(fit(&line).is_ok_and(|found| found.world_from_blade.scale.is_finite()));
}
