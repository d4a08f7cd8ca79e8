//! Smooth joint angles: cosine waves along veins and ribs, rich enough for any organ that does not crumple.
//!
//! Raw angles are fitted in these modes and every learned basis lies in their span. They hold no rigid motion: the
//! first bone of a vein or stem never turns, and the ribs' common roll is 0. That is the gauge of
//! spec/demeter-model.md written as linear conditions on angles, which principal components inherit.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use crate::model::leaf::{ANGLES, ROWS, Side, VEIN, side_angle, vein_angle};
use crate::model::species::SpeciesError;
use crate::model::stem::{self, BONES};
use crate::model::{Basis, Habit, Species};

/// Waves of the main vein out of the blade; 9 half waves resolve a bend of a tenth of the blade.
const ARCHES: usize = 10;
/// Waves of the main vein within the blade.
const BOWS: usize = 4;
/// The modes of the main vein; those of the ribs follow them.
pub(super) const VEIN_MODES: usize = ARCHES + BOWS;
/// Waves from row to row of what the ribs do.
const RIB_WAVES: usize = 5;
/// Waves of a stem in each direction.
const STEM_WAVES: usize = 12;
/// Total turn from base to tip of one σ of the slowest wave, radians: generous, half a turn is within 3 σ.
const ARCH: f64 = 1.0;
/// How much more a grass's long blades turn: 3 σ are more than three quarters of a circle.
const GRASS: f64 = 1.6;
/// The same within the blade, which is stiff there.
const BOW: f64 = 0.3;
/// Total turn of one σ of a rib from the vein to the edge.
const CURL: f64 = 0.6;
/// Turn of one σ of a rib within the blade.
const SHEAR: f64 = 0.1;
/// Total turn of one σ of a stem.
const STEM_BEND: f64 = 0.8;

/// The species with smooth modes in place of its deformation bases: what raw angles are fitted with.
///
/// # Errors
/// [`SpeciesError`] when a basis is refused, which the tests rule out.
pub(super) fn smooth(species: &Species) -> Result<Species, SpeciesError> {
    let mut smooth = species.clone();
    smooth.leaf.deform = Basis::from_modes(DVector::zeros(ANGLES), &DMatrix::from_rows(&leaf_modes(species.habit)))?;
    smooth.stem.deform = Basis::from_modes(DVector::zeros(stem::ANGLES), &DMatrix::from_rows(&stem_modes()))?;
    smooth.sealed()
}

pub(super) type Mode = nalgebra::RowDVector<f64>;

/// Half wave `m` at the middle of bone `i` of `count`.
fn wave(m: usize, i: usize, count: usize) -> f64 {
    (PI * m as f64 * (i as f64 + 0.5) / count as f64).cos()
}

/// One σ falls with the wave number as that of a beam that is bent at random.
fn fall(m: usize) -> f64 {
    1.0 / (1.0 + m as f64)
}

/// Smooth changes of a flat grid `[45*43*2]`, one σ each: wider here and narrower there along the vein, one side wider
/// than the other, the widest part swept along. Base and tip stay. The shares of the width are guesses.
pub(super) fn shape_modes(mean: &DVector<f64>) -> Vec<Mode> {
    let mode = |x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64| {
        Mode::from_fn(mean.len(), |_, q| {
            let (across, along) = (mean[q - q % 2], mean[q - q % 2 + 1]);
            if q % 2 == 0 { across * x(along) } else { across.abs() * y(along) }
        })
    };
    let still = |_: f64| 0.0;
    let wave = |m: usize| move |v: f64| (PI * m as f64 * v).cos();
    let mut modes: Vec<Mode> = (0..5).map(|m| mode(&|v| 0.3 * fall(m) * wave(m)(v), &still)).collect();
    let half = |m: usize| {
        Mode::from_fn(mean.len(), |_, q| if q % 2 == 0 { 0.1 * mean[q].abs() * wave(m)(mean[q + 1]) } else { 0.0 })
    };
    modes.extend((0..2).map(half));
    modes.extend((1..3).map(|m| mode(&still, &|v| 0.2 * fall(m) * (PI * m as f64 * v).sin())));
    modes
}

fn leaf_modes(habit: Habit) -> Vec<Mode> {
    let arch = if habit == Habit::Grass { GRASS * ARCH } else { ARCH };
    let mut modes = Vec::new();
    let bones = ROWS - 2;
    for (offset, waves, turn) in [(0, ARCHES, arch), (1, BOWS, BOW)] {
        for m in 0..waves {
            let mut mode = Mode::zeros(ANGLES);
            for i in 0..bones {
                mode[vein_angle(i + 2) + offset] = turn * fall(m).sqrt() / bones as f64 * wave(m, i, bones);
            }
            modes.push(mode);
        }
    }
    // Along a rib: a hinge at the vein, an even curl, and two waves of it.
    let profiles: [&dyn Fn(usize) -> f64; 4] =
        [&|k| if k == 0 { 1.0 } else { 0.0 }, &|_| 1.0 / VEIN as f64, &|k| wave(1, k, VEIN) / VEIN as f64, &|k| {
            wave(2, k, VEIN) / VEIN as f64
        }];
    let rows = ROWS - 2;
    for (p, profile) in profiles.iter().enumerate() {
        for m in 0..RIB_WAVES {
            // Both sides up together, then one up and one down.
            for left in [1.0, -1.0] {
                let mut mode = Mode::zeros(ANGLES);
                for (i, side, k) in joints() {
                    let sign = if side == Side::Left { left } else { -1.0 };
                    let turn = CURL * fall(m) * fall(p.saturating_sub(1)).sqrt();
                    mode[side_angle(i + 1, side, k + 1)] = sign * turn * profile(k) * wave(m, i, rows);
                }
                // A hinge that turns all ribs alike is roll and nothing else.
                if !(p == 0 && m == 0 && left < 0.0) {
                    modes.push(without_roll(mode));
                }
            }
        }
    }
    // Within the blade, ribs sweep towards the tip or the base.
    for m in 0..2 {
        for left in [1.0, -1.0] {
            let mut mode = Mode::zeros(ANGLES);
            for (i, side, k) in joints() {
                let sign = if side == Side::Left { left } else { -1.0 };
                mode[side_angle(i + 1, side, k + 1) + 1] = sign * SHEAR / VEIN as f64 * wave(m, i, rows);
            }
            modes.push(mode);
        }
    }
    modes
}

/// Every joint of the ribs: row less 1, side, bone less 1.
fn joints() -> impl Iterator<Item = (usize, Side, usize)> {
    (0..ROWS - 2).flat_map(|i| Side::BOTH.into_iter().flat_map(move |side| (0..VEIN).map(move |k| (i, side, k))))
}

/// Takes the mean turn of all ribs at the vein out of a mode.
fn without_roll(mut mode: Mode) -> Mode {
    let hinges: Vec<usize> = (1..ROWS - 1).flat_map(|row| Side::BOTH.map(|side| side_angle(row, side, 1))).collect();
    let roll = hinges.iter().map(|q| mode[*q]).sum::<f64>() / hinges.len() as f64;
    hinges.iter().for_each(|q| mode[*q] -= roll);
    mode
}

/// Waves towards +z, then the same within the blade's plane.
fn stem_modes() -> Vec<Mode> {
    let bones = BONES - 1;
    let modes = (0..STEM_WAVES).flat_map(|m| {
        [0, 1].map(|offset| {
            let mut mode = Mode::zeros(stem::ANGLES);
            for i in 0..bones {
                mode[2 * (i + 1) + offset] = STEM_BEND * fall(m).sqrt() / bones as f64 * wave(m, i, bones);
            }
            mode
        })
    });
    modes.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::mirror::{mirrored_leaf, mirrored_stem};
    use crate::species::generic;

    #[test]
    fn smooth_modes_hold_no_rigid_motion_and_are_closed_under_the_mirror() {
        let smooth = smooth(&generic("soybean").expect("listed").expect("valid")).expect("independent");
        let (leaf, stem) = (&smooth.leaf.deform, &smooth.stem.deform);
        for k in 0..leaf.rank() {
            let mut one = vec![0.0; leaf.rank()];
            one[k] = 1.0;
            let angles = leaf.at(&one);
            assert_eq!((angles[vein_angle(1)], angles[vein_angle(1) + 1]), (0.0, 0.0));
            let hinges = (1..ROWS - 1).flat_map(|row| Side::BOTH.map(|side| angles[side_angle(row, side, 1)]));
            assert!(hinges.sum::<f64>().abs() < 1e-5, "mode {k} rolls the blade");
            let image = mirrored_leaf(&angles);
            assert!((leaf.at(&leaf.project(&image)) - image).amax() < 1e-5, "mode {k} leaves the span");
        }
        for k in 0..stem.rank() {
            let mut one = vec![0.0; stem.rank()];
            one[k] = 1.0;
            let angles = stem.at(&one);
            assert_eq!((angles[0], angles[1]), (0.0, 0.0));
            let image = mirrored_stem(&angles);
            assert!((stem.at(&stem.project(&image)) - image).amax() < 1e-5, "stem mode {k} leaves the span");
        }
    }
}
