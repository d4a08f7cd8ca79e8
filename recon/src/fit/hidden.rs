//! What nobody saw of a plant's blades, from what its blades have in common.
//!
//! A blade that lost points inside its outline will have lost some of its edge as well, and a leaflet much smaller than
//! the others of its leaf is a part of one.

use std::collections::BTreeMap;

use crate::statistics::quantile;

/// Share of the blades that may have lost points: the density of those above is the full one (a guess).
const FULL: f64 = 0.75;
/// Difference between the logarithms of areas of leaflets of one leaf that tells nothing: the middle one is larger.
const SIBLINGS: f64 = 0.25;
/// Most that is said of a blade, in its own areas: one that lost nearly everything could be of any size.
const MOST: f64 = 10.0;

/// A fitted blade.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    /// Points of its cloud.
    pub points: f64,
    /// Square metres.
    pub area: f64,
    /// Its leaf.
    pub leaf: u16,
}

/// The share of its area, as fitted, that each blade may have beyond it.
pub(super) fn shares(blades: &[Outline]) -> Vec<f64> {
    let density = |blade: &Outline| blade.points / blade.area.max(f64::MIN_POSITIVE);
    let full = quantile(blades.iter().map(density), FULL).unwrap_or(0.0);
    // Of each leaf: its blades and the sum of the logarithms of their areas.
    let mut leaves = BTreeMap::<u16, (f64, f64)>::new();
    for blade in blades {
        let (count, logs) = leaves.entry(blade.leaf).or_default();
        *count += 1.0;
        *logs += blade.area.ln();
    }
    let share = |blade: &Outline| {
        let lost = (full / density(blade) - 1.0).max(0.0);
        let (count, logs) = leaves[&blade.leaf];
        let larger = if count > 1.0 { (logs - count * blade.area.ln()) / (count - 1.0) } else { 0.0 };
        let share = lost.hypot((larger - SIBLINGS).max(0.0).exp_m1());
        if share.is_finite() { share.min(MOST) } else { MOST }
    };
    blades.iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_points_and_small_leaflets_are_doubted() {
        let whole = |leaf| Outline { points: 1000.0, area: 0.01, leaf };
        let part = Outline { area: 0.004, points: 400.0, leaf: 0 };
        let holed = Outline { points: 600.0, ..whole(2) };
        let found = shares(&[whole(0), whole(0), part, whole(1), whole(1), whole(1), holed]);
        assert!(found[..2].iter().chain(&found[3..6]).all(|share| *share < 1e-12), "{found:?}");
        // The others are 2.5 times as large.
        assert!((0.5..1.5).contains(&found[2]) && (found[6] - 2.0 / 3.0).abs() < 1e-12, "{found:?}");
        assert!(shares(&[]).is_empty());
        let nothing = Outline { points: 0.0, area: 0.0, leaf: 3 };
        assert!(shares(&[nothing, whole(0)]).iter().all(|share| share.is_finite()));
    }
}
