//! Species before anything is learned: smooth analytic modes written by hand, each number with its source.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use crate::model::leaf::{ANGLES, COLUMNS, LeafModel, POINTS, ROWS, Side, VEIN, node, side_angle, vein_angle};
use crate::model::stem::{self, BONES, StemModel};
use crate::model::{Basis, Habit, Range, Ranges, Species, species::SpeciesError};

/// A species as it is before anything is learned: what `demeter learn` starts from, and what stands in for data that
/// is missing. The names are those of [`super::NAMES`]; `None` for any other.
///
/// # Errors
/// [`SpeciesError`] when a basis is refused, which the tests rule out.
pub fn generic(name: &str) -> Option<Result<Species, SpeciesError>> {
    match name {
        "soybean" => Some(trifoliate("soybean", 0.31)),
        "bean" => Some(trifoliate("bean", 0.36)),
        "cowpea" => Some(trifoliate("cowpea", 0.30)),
        "maize" => Some(grass("maize", 0.042, 0.03)),
        "sorghum" => Some(grass("sorghum", 0.035, 0.02)),
        "tobacco" => Some(broadleaf("tobacco", Habit::Simple, 0.28, 0.02)),
        "pepper" => Some(broadleaf("pepper", Habit::Simple, 0.26, 0.0125)),
        "tomato" => Some(broadleaf("tomato", Habit::Compound, 0.26, 0.0125)),
        _ => None,
    }
}

/// A legume with trifoliate leaves on petioles; `half_width` is that of a leaflet in its lengths (0.31 is the look of
/// soybean's scans; all are guesses).
fn trifoliate(name: &str, half_width: f64) -> Result<Species, SpeciesError> {
    // Soybean leaflets 3 to 15 cm, petioles to 30 cm (Lersten & Carlson, "Vegetative Morphology", Soybeans:
    // Improvement, Production, and Uses, 3rd ed. 2004); the ends are widened by a guess so that fits do not stick to
    // them and bean and cowpea have room. No stem of the three is thicker than 15 mm (a guess; soybeans measure 5 to 12):
    // a bundle of petioles that was not taken apart must not pass for one.
    let ranges = Ranges {
        blade_length: Range::new(0.005, 0.30),
        stem_length: Range::new(0.003, 2.0),
        stem_radius: Range::new(0.0003, 0.0075),
        blade_width: Range::new(1.0, 1.0),
    };
    Species::new(name, Habit::Compound, ranges, PROVENANCE, &leaf(|v| ovate(half_width, v), 1.0)?, &stem()?)
}

/// A grass: strap leaves straight from the main stem. `half_width` is that of a blade in blade lengths at s_x = 1,
/// `stem_radius` the thickest stem's in metres.
fn grass(name: &str, half_width: f64, stem_radius: f64) -> Result<Species, SpeciesError> {
    // Maize blades to 1.2 m long and 12 cm wide, plants to 3 m (Kiesselbach, The Structure and Reproduction of Corn,
    // 1949); sorghum a little narrower. Seedlings' first leaves are spoons, hence the wide end of s_x (a guess).
    let ranges = Ranges {
        blade_length: Range::new(0.005, 1.5),
        stem_length: Range::new(0.003, 4.0),
        stem_radius: Range::new(0.0003, stem_radius),
        blade_width: Range::new(0.3, 8.0),
    };
    // Nearly parallel edges that narrow to the tip.
    let outline = |v: f64| half_width * (1.0 - (1.0 - v).powi(12)).max(0.0).sqrt() * (1.0 - v.powi(3)).powf(0.8);
    Species::new(name, Habit::Grass, ranges, PROVENANCE, &leaf(outline, 1.6)?, &stem()?)
}

/// A broad-leaved species with ovate blades whose half width is `half_width` blade lengths; `stem_radius` is the thickest
/// stem's in metres (guesses for each).
fn broadleaf(name: &str, habit: Habit, half_width: f64, stem_radius: f64) -> Result<Species, SpeciesError> {
    let ranges = Ranges {
        blade_length: Range::new(0.003, 0.6),
        stem_length: Range::new(0.002, 2.5),
        stem_radius: Range::new(0.0003, stem_radius),
        blade_width: Range::new(1.0, 1.0),
    };
    Species::new(name, habit, ranges, PROVENANCE, &leaf(|v| ovate(half_width, v), 1.0)?, &stem()?)
}

/// Half width at v of an ovate leaf that is widest (`half_width`) at 0.4 of its length.
fn ovate(half_width: f64, v: f64) -> f64 {
    half_width * (v / 0.4).powf(0.62) * ((1.0 - v) / 0.6).powf(0.93)
}

const PROVENANCE: &str = "analytic modes written by hand (recon/src/species/generic.rs); learned from no data";

/// A leaf whose flat half width at v (0 base, 1 tip) is given in blade lengths; `bend` scales how far the main vein
/// bends per σ.
fn leaf(half_width: impl Fn(f64) -> f64, bend: f64) -> Result<LeafModel, SpeciesError> {
    let v_of = |i: usize| i as f64 / (ROWS - 1) as f64;
    let u_of = |j: usize| j as f64 / VEIN as f64 - 1.0;
    let grid = |x: &dyn Fn(f64, f64) -> f64, y: &dyn Fn(f64, f64) -> f64| {
        let mut xy = DVector::zeros(POINTS * 2);
        for (i, j) in (0..ROWS).flat_map(|i| (0..COLUMNS).map(move |j| (i, j))) {
            let n = node(i, j);
            xy[2 * n] = x(v_of(i), u_of(j)) * half_width(v_of(i));
            xy[2 * n + 1] = y(v_of(i), u_of(j));
        }
        xy
    };
    let still = |_: f64, _: f64| 0.0;
    let mean = grid(&|_, u| u, &|v, _| v);
    // One σ each: width ±15 %, widest point towards the tip, waist, one side wider, finer taper, lobed shoulders.
    let modes = [
        grid(&|_, u| 0.15 * u, &still),
        grid(&|v, u| 0.15 * u * (PI * v).cos(), &still),
        grid(&|v, u| 0.08 * u * (2.0 * PI * v).cos(), &still),
        grid(&|_, u| 0.06 * u.abs(), &still),
        grid(&|v, u| 0.05 * u * (3.0 * PI * v).cos(), &still),
        grid(&still, &|v, u| 0.04 * u * u * (PI * v).sin()),
    ];
    let shape = Basis::from_modes(mean, &rows(&modes))?;
    Ok(LeafModel { shape, deform: Basis::from_modes(DVector::zeros(ANGLES), &rows(&bends(bend)))? })
}

/// Smooth joint-angle modes of a blade; each is one σ, angles in radians.
fn bends(bend: f64) -> Vec<DVector<f64>> {
    let wave = |i: usize, m: usize| (PI * m as f64 * (i as f64 - 0.5) / (ROWS - 1) as f64).cos();
    let bones = (ROWS - 1) as f64;
    let mut modes = Vec::new();
    let mut vein = |offset: usize, m: usize, total: f64| {
        let mut angles = DVector::zeros(ANGLES);
        for i in 1..ROWS {
            angles[vein_angle(i) + offset] = total / bones * wave(i, m);
        }
        modes.push(angles);
    };
    // Arching out of the blade: the total turn from base to tip, then where along the vein it happens.
    for (m, total) in [0.6, 0.6, 0.5, 0.4, 0.3].into_iter().enumerate() {
        vein(0, m, -total * bend);
    }
    // Bowing within the blade.
    for (m, total) in [0.2, 0.15, 0.1].into_iter().enumerate() {
        vein(1, m, total);
    }
    let mut ribs = |m: usize, angle: &dyn Fn(Side, usize) -> f64| {
        let mut angles = DVector::zeros(ANGLES);
        for i in 1..ROWS - 1 {
            for (side, k) in Side::BOTH.into_iter().flat_map(|s| (1..=VEIN).map(move |k| (s, k))) {
                angles[side_angle(i, side, k)] = angle(side, k) * wave(i, m);
            }
        }
        modes.push(angles);
    };
    let mirrored = |side: Side| if side == Side::Left { 1.0 } else { -1.0 };
    for m in 0..2 {
        // Folding at the main vein lifts both halves; curling bends each rib all along.
        ribs(m, &|side, k| if k == 1 { 0.3 * mirrored(side) } else { 0.0 });
        ribs(m, &|side, _| 0.4 / VEIN as f64 * mirrored(side));
    }
    // Twisting: rows turn about the vein, more towards the tip; a common turn would be roll, which is the joint's.
    for (m, angle) in [(1, 0.3), (2, 0.2), (3, 0.15)] {
        ribs(m, &|_, k| if k == 1 { angle } else { 0.0 });
    }
    modes
}

/// Stems: bows and kinks in both directions.
fn stem() -> Result<StemModel, SpeciesError> {
    let wave = |i: usize, m: usize| (PI * m as f64 * (i as f64 - 0.5) / BONES as f64).cos();
    let mut modes = Vec::new();
    for (m, total) in [0.5, 0.4, 0.3, 0.25, 0.2].into_iter().enumerate() {
        for offset in 0..2 {
            let mut angles = DVector::zeros(stem::ANGLES);
            for i in 1..=BONES {
                angles[2 * (i - 1) + offset] = total / BONES as f64 * wave(i, m);
            }
            modes.push(angles);
        }
    }
    Ok(StemModel { deform: Basis::from_modes(DVector::zeros(stem::ANGLES), &rows(&modes))? })
}

fn rows(modes: &[DVector<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(modes.len(), modes[0].len(), |k, n| modes[k][n])
}
