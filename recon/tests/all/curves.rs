//! Laws of Catmull-Rom curves and of inverse kinematics.

use crate::common::{cases, species};
use demeter_frame::Pose;
use demeter_recon::model::leaf::{ANGLES, BladeGrid, COLUMNS, ROWS, VEIN, node};
use demeter_recon::model::stem::{self, BONES, StemCurve};
use demeter_recon::model::{Knots, leaf_angles, refine, stem_angles};
use glam::{DQuat, DVec3};
use nalgebra::DVector;
use proptest::prelude::*;

const BOTH: [Knots; 2] = [Knots::Uniform, Knots::Centripetal];

fn points() -> impl Strategy<Value = Vec<DVec3>> {
    prop::collection::vec([-1.0..1.0_f64, -1.0..1.0, -1.0..1.0].prop_map(DVec3::from_array), 2..9)
}

/// The curve by Barry and Goldman's pyramid of linear interpolations, an independent way to the same points; knots are
/// apart by chord^alpha, 0 for uniform ones and 0.5 for centripetal ones.
fn pyramid(points: &[DVec3], steps: usize, alpha: f64) -> Vec<DVec3> {
    let n = points.len();
    let ends = [2.0 * points[0] - points[1], 2.0 * points[n - 1] - points[n - 2]];
    let all = [&ends[..1], points, &ends[1..]].concat();
    let mut curve = Vec::new();
    for p in all.windows(4) {
        let mut knots = [0.0; 4];
        for i in 1..4 {
            knots[i] = knots[i - 1] + p[i].distance(p[i - 1]).powf(alpha);
        }
        for step in 0..steps {
            let t = knots[1] + (knots[2] - knots[1]) * step as f64 / steps as f64;
            let mut level = p.to_vec();
            // First knot and span of each level of the pyramid.
            for (first, span) in [(0, 1), (0, 2), (1, 1)] {
                let mix = |i: usize| {
                    let (a, b) = (knots[first + i], knots[first + i + span]);
                    (level[i] * (b - t) + level[i + 1] * (t - a)) / (b - a)
                };
                level = (0..level.len() - 1).map(mix).collect();
            }
            curve.push(level[0]);
        }
    }
    curve.push(points[n - 1]);
    curve
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn curves_are_those_of_the_pyramid(points in points(), steps in 2..6_usize) {
        for (knots, alpha) in [(Knots::Uniform, 0.0), (Knots::Centripetal, 0.5)] {
            for (a, b) in refine(&points, steps, knots).iter().zip(pyramid(&points, steps, alpha)) {
                prop_assert!(a.distance(b) < 1e-9, "{knots:?}: {a} and {b}");
            }
        }
    }

    #[test]
    fn curves_turn_with_their_points_and_run_both_ways(
        points in points(), axis in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], scale in 0.1..10.0_f64,
    ) {
        let motion = Pose::new(DQuat::from_scaled_axis(DVec3::from_array(axis)), DVec3::new(3.0, -1.0, 2.0));
        let moved: Vec<DVec3> = points.iter().map(|p| motion.point(*p * scale)).collect();
        let back: Vec<DVec3> = points.iter().rev().copied().collect();
        for knots in BOTH {
            let curve = refine(&points, 5, knots);
            for (a, b) in curve.iter().zip(refine(&moved, 5, knots)) {
                prop_assert!(motion.point(*a * scale).distance(b) < 1e-9 * scale.max(1.0));
            }
            for (a, b) in curve.iter().rev().zip(refine(&back, 5, knots)) {
                prop_assert!(a.distance(b) < 1e-9);
            }
        }
    }

    #[test]
    fn points_that_coincide_leave_curves_finite(mut points in points(), at in any::<prop::sample::Index>()) {
        let at = at.index(points.len() - 1);
        points[at + 1] = points[at];
        prop_assert!(BOTH.into_iter().all(|knots| refine(&points, 4, knots).iter().all(|p| p.is_finite())));
    }
}

proptest! {
    #![proptest_config(cases(12))]

    #[test]
    fn joint_angles_of_a_bent_blade_bend_it_again(seed in prop::collection::vec(-0.2..0.2_f64, 64), width in 0.5..2.0_f64) {
        let flat = species("tomato").leaf.flat(&[1.0, -1.5], width);
        let angles = DVector::from_fn(ANGLES, |i, _| seed[i % 64] * seed[(i / 64) % 64] * 5.0);
        let bent = BladeGrid::bent(&flat, &angles).points;
        let again = BladeGrid::bent(&flat, &leaf_angles(&flat, &bent)).points;
        for (a, b) in bent.iter().zip(&again) {
            prop_assert!(a.distance(*b) < 1e-9, "{a} and {b}");
        }
    }

    #[test]
    fn joint_angles_of_a_bent_stem_bend_it_again(angles in prop::collection::vec(-0.4..0.4_f64, stem::ANGLES), lengths in prop::collection::vec(0.01..0.1_f64, BONES)) {
        let bent = StemCurve::bent(&lengths, &DVector::from_vec(angles)).points;
        let again = StemCurve::bent(&lengths, &stem_angles(&bent)).points;
        for (a, b) in bent.iter().zip(&again) {
            prop_assert!(a.distance(*b) < 1e-9, "{a} and {b}");
        }
        for (k, p) in bent.windows(2).enumerate() {
            prop_assert!((p[0].distance(p[1]) - lengths[k]).abs() < 1e-12);
        }
    }
}

/// Whatever a species' mean bend is, no angle at all gives its template.
#[test]
fn zero_angles_give_the_flat_leaf_and_the_straight_stem() {
    for name in demeter_recon::species::NAMES {
        let flat = species(name).leaf.flat(&[], 1.0);
        let grid = BladeGrid::bent(&flat, &DVector::zeros(ANGLES)).points;
        for (n, p) in grid.iter().enumerate() {
            assert!(p.distance(flat[n].extend(0.0)) < 1e-6, "{name} node {} {}", n / COLUMNS, n % COLUMNS);
        }
        assert!(leaf_angles(&flat, &grid).amax() < 1e-5);
    }
    let straight = StemCurve::bent(&[1.0 / BONES as f64; BONES], &DVector::zeros(stem::ANGLES));
    for (i, p) in straight.points.iter().enumerate() {
        assert!(p.distance(DVec3::Y * i as f64 / BONES as f64) < 1e-12);
    }
    // A leaf folded back on itself has angles too.
    let flat = species("bean").leaf.flat(&[], 1.0);
    let mut folded: Vec<DVec3> = flat.iter().map(|p| p.extend(0.0)).collect();
    for p in folded.iter_mut().skip(node(ROWS / 2, 0)) {
        p.y = 2.0 * flat[node(ROWS / 2, VEIN)].y - p.y;
    }
    assert!(leaf_angles(&flat, &folded).iter().all(|a| a.is_finite()));
}
