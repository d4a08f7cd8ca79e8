//! How far each parameter moves a plant's vertices: what decides its quantum.

use glam::{DQuat, DVec3};

use crate::model::leaf::{Blade, across};
use crate::model::{Species, stem};

/// Binary logarithms, rounded, of the root-mean-square shift of an organ's control points, in organ sizes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Effects {
    /// Per σ of each shape coefficient.
    pub(super) beta: Vec<i32>,
    /// Per σ of each deformation coefficient of leaves.
    pub(super) leaf_gamma: Vec<i32>,
    /// Per σ of each deformation coefficient of stems.
    pub(super) stem_gamma: Vec<i32>,
    /// Per unit of ln s_x.
    pub(super) leaf_width: i32,
    /// Per radian of a blade's roll about its chord.
    pub(super) leaf_roll: i32,
}

impl Effects {
    /// The effects at the species' mean leaf and stem.
    pub(super) fn of(species: &Species) -> Self {
        let mean = Blade { beta: Vec::new(), gamma: Vec::new(), width: 1.0 };
        let leaf = species.leaf.jacobian(&mean);
        let gauge = species.leaf.grid(&mean).gauge;
        let mut shifts = gauged_shifts(&leaf.points, |n, k| leaf.derivative(n, k), leaf.coefficients, gauge, across);
        let leaf_width = octaves(shifts.pop().unwrap_or(0.0));
        let roll = leaf.points.iter().map(|p| (gauge * *p).with_y(0.0).length_squared()).sum::<f64>();
        let leaf_gamma = shifts.split_off(species.leaf.shape.rank());
        let stem = species.stem.jacobian(&[]);
        let bows = gauged_shifts(
            &stem.points,
            |n, k| stem.derivatives[n * stem.coefficients + k],
            stem.coefficients,
            stem::gauge(&stem.points),
            |_| DVec3::ZERO,
        );
        let round = |shifts: Vec<f64>| shifts.into_iter().map(octaves).collect();
        Self {
            beta: round(shifts),
            leaf_gamma: round(leaf_gamma),
            stem_gamma: round(bows),
            leaf_width,
            leaf_roll: octaves((roll / leaf.points.len() as f64).sqrt()),
        }
    }
}

/// The rounded binary logarithm, within what matters.
fn octaves(shift: f64) -> i32 {
    shift.max(f64::MIN_POSITIVE).log2().round().clamp(-20.0, 4.0) as i32
}

/// Root-mean-square shift of the points by each of `coefficients`, after the gauge has taken back what is rotation:
/// the tip (the last point) goes back to the chord, and what is `across` the organ to z = 0. Stems have nothing across:
/// what rolls a bowed mean stem sideways bends one that is straighter, so of them no roll is taken back.
fn gauged_shifts(
    points: &[DVec3],
    derivative: impl Fn(usize, usize) -> DVec3,
    coefficients: usize,
    gauge: DQuat,
    across: impl Fn(&[DVec3]) -> DVec3,
) -> Vec<f64> {
    let points: Vec<DVec3> = points.iter().map(|p| gauge * *p).collect();
    let tip = points.len() - 1;
    (0..coefficients)
        .map(|k| {
            let moved = |n: usize| gauge * derivative(n, k);
            let chord = points[tip].y.max(1e-3);
            let back = DVec3::new(-moved(tip).z, 0.0, moved(tip).x) / chord;
            let shifts: Vec<DVec3> = points.iter().enumerate().map(|(n, p)| moved(n) + back.cross(*p)).collect();
            let width = across(&points).x;
            let roll = if width > 1e-9 { across(&shifts).z / width } else { 0.0 };
            let left: f64 =
                shifts.iter().zip(&points).map(|(s, p)| (*s + DVec3::Y.cross(*p) * roll).length_squared()).sum();
            (left / points.len() as f64).sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::species::{NAMES, shipped};

    #[test]
    fn effects_are_those_of_the_gauged_forms() {
        for name in NAMES {
            let species = shipped(name).expect("listed").expect("valid");
            let effects = Effects::of(&species);
            for (k, effect) in effects.leaf_gamma.iter().enumerate() {
                let bent = |c: f64| {
                    let mut gamma = vec![0.0; k + 1];
                    gamma[k] = c;
                    species.leaf.grid(&Blade { beta: Vec::new(), gamma, width: 1.0 }).points
                };
                let (a, b) = (bent(0.01), bent(-0.01));
                let total: f64 = a.iter().zip(&b).map(|(a, b)| ((*a - *b) / 0.02).length_squared()).sum();
                let found = (total / a.len() as f64).sqrt().log2();
                // Half an octave by rounding; the rest is the curvature within the difference.
                assert!((found - f64::from(*effect)).abs() < 0.51, "{name} γ{k}: {found} and {effect}");
            }
        }
    }

    /// The decoder's probabilities hang on these whole numbers, so no machine's rounding may tip them.
    #[test]
    fn no_shipped_effect_lies_where_rounding_could_tip_it() {
        for name in NAMES {
            let species = shipped(name).expect("listed").expect("valid");
            let mean = Blade { beta: Vec::new(), gamma: Vec::new(), width: 1.0 };
            let leaf = species.leaf.jacobian(&mean);
            let gauge = species.leaf.grid(&mean).gauge;
            let stem = species.stem.jacobian(&[]);
            let mut shifts =
                gauged_shifts(&leaf.points, |n, k| leaf.derivative(n, k), leaf.coefficients, gauge, across);
            let turn = stem::gauge(&stem.points);
            shifts.extend(gauged_shifts(
                &stem.points,
                |n, k| stem.derivatives[n * stem.coefficients + k],
                stem.coefficients,
                turn,
                |_| DVec3::ZERO,
            ));
            for shift in shifts.into_iter().filter(|s| *s > 1e-6) {
                let fraction = shift.log2().rem_euclid(1.0);
                assert!((fraction - 0.5).abs() > 1e-6, "{name}: {shift}");
            }
        }
    }
}
