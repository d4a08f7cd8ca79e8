use std::f64::consts::{PI, TAU};

use nalgebra::DVector;
use proptest::prelude::*;

use super::*;
use crate::fit::stem;

/// Its first bends are slow waves whatever is learned.
fn soybean() -> Species {
    crate::species::generic("soybean").expect("listed").expect("valid")
}

fn bent(species: &Species, bends: &[f64]) -> Tube {
    let gamma = (0..species.stem.deform.rank()).map(|k| bends.get(k).copied().unwrap_or(0.0)).collect();
    let rotation = DQuat::from_rotation_x(1.2);
    Tube { base: DVec3::new(1.0, -2.0, 0.5), rotation, log_length: 0.3_f64.ln(), gamma, log_radius: 0.005_f64.ln() }
}

/// Points on a tube from its base to its tip, where `seen` of the turn about its axis is in view; rows of 4 mm.
fn points(tube: &Tube, species: &Species, seen: f64, noise: f64) -> Vec<DVec3> {
    let rows = Rows::of(tube, species);
    let mut points = Vec::new();
    for step in 0..=75 {
        let at = f64::from(step) / 75.0 * BONES as f64;
        let bone = (at as usize).min(BONES - 1);
        let direction = rows.direction(bone);
        let side = DVec3::X.reject_from_normalized(direction).normalize();
        for k in 0..16 {
            let turn = DQuat::from_axis_angle(direction, seen * TAU * (f64::from(k) / 15.0 - 0.5));
            // Noise without a random number: it looks like none to the fit.
            let off = noise * (f64::from(step * 16 + k) * 12.9898).sin() * 2f64.sqrt();
            points.push(rows.place(bone, at - bone as f64) + turn * side * (tube.radius() + off));
        }
    }
    points
}

/// Largest distance between the axes of a fit from the tube's points and of the tube itself, and the radius found.
fn fitted(tube: &Tube, species: &Species, points: &[DVec3]) -> (f64, f64) {
    let fit = stem::fit(points, tube.base, species);
    let curve = species.stem.curve(&fit.gamma);
    let axis = Rows::of(tube, species).axis;
    let off = curve.points.iter().zip(&axis).map(|(p, q)| (tube.base + fit.rotation * (*p * fit.length)).distance(*q));
    (off.fold(0.0, f64::max), fit.radius)
}

#[test]
fn half_a_tube_tells_the_whole() {
    let species = soybean();
    for bends in [&[][..], &[1.5, -1.0, 0.7]] {
        let tube = bent(&species, bends);
        for (seen, noise, tolerance) in [(1.0, 0.0, 0.001), (0.5, 0.0, 0.001), (0.4, 0.0003, 0.002)] {
            let (off, radius) = fitted(&tube, &species, &points(&tube, &species, seen, noise));
            assert!(
                off < tolerance && (radius / 0.005 - 1.0).abs() < 0.1,
                "{bends:?} {seen}: off {off}, radius {radius}"
            );
        }
    }
    // The negative control: the middle of the half that is seen is off the axis by 2/π of the radius.
    let tube = bent(&species, &[]);
    let half = points(&tube, &species, 0.5, 0.0);
    let middle = half.iter().copied().sum::<DVec3>() / half.len() as f64;
    let rows = Rows::of(&tube, &species);
    assert!((crate::polyline::distance_to_path(middle, &rows.axis) - 2.0 / PI * 0.005).abs() < 0.0005);
}

#[test]
fn leaf_points_among_a_stems_do_not_swell_it() {
    let species = soybean();
    let tube = bent(&species, &[0.5]);
    let mut cloud = points(&tube, &species, 1.0, 0.0);
    let strays = cloud.len() / 12;
    cloud.extend((0..strays).map(|i| tube.base + DVec3::new(0.02 + 0.0001 * i as f64, 0.03, 0.1)));
    let (off, radius) = fitted(&tube, &species, &cloud);
    assert!(off < 0.004 && (radius / 0.005 - 1.0).abs() < 0.15, "off {off}, radius {radius}");
}

#[test]
fn a_single_row_of_points_is_a_thin_stem() {
    let species = soybean();
    let tube = bent(&species, &[1.0, 0.5]);
    let row = Rows::of(&tube, &species).axis;
    let (off, radius) = fitted(&tube, &species, &row);
    assert!(off < 0.002 && radius < 0.001, "off {off}, radius {radius}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// The analytic gradient of a place on the axis against central differences.
    #[test]
    fn gradients_are_those_of_finite_differences(
        bends in prop::collection::vec(-2.0..2.0_f64, 10), bone in 0..BONES, t in 0.0..1.0_f64, which in 0..3_usize,
    ) {
        let species = soybean();
        let tube = bent(&species, &bends);
        let direction = DVec3::AXES[which];
        let analytic = Rows::of(&tube, &species).gradient(bone, t, direction).to_vec();
        const EPSILON: f64 = 1e-6;
        for (k, expected) in analytic.iter().enumerate().skip(3).take(analytic.len() - 4) {
            let at = |sign: f64| {
                let mut step = DVector::zeros(analytic.len() - 3);
                step[k - 3] = sign * EPSILON;
                let moved = tube.stepped(step.as_slice(), &species.ranges);
                Rows::of(&moved, &species).place(bone, t).dot(direction)
            };
            let found = (at(1.0) - at(-1.0)) / (2.0 * EPSILON);
            prop_assert!((found - expected).abs() < 1e-7, "column {k}: {found}, expected {expected}");
        }
    }
}
