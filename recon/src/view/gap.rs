//! Distances between clouds, robust against strays.

use glam::DVec3;

use crate::nearest::Nearest;

/// Most points of a cloud that are looked at: enough to hit a 2 % contact zone, few enough for rows of plants.
const SAMPLES: usize = 400;
/// Of the sorted nearest distances the one at this share is the gap: the release takes the 1st percentile
/// (reconstruction.md "Organs to a tree").
const PERCENTILE: f64 = 0.01;

/// A thinned cloud with its box and a tree for nearest points.
pub(super) struct Near {
    points: Vec<DVec3>,
    tree: Nearest,
    low: DVec3,
    high: DVec3,
}

impl Near {
    pub(super) fn new(points: &[DVec3]) -> Self {
        let step = points.len().div_ceil(SAMPLES).max(1);
        let points: Vec<DVec3> = points.iter().copied().step_by(step).collect();
        let tree = Nearest::of(&points);
        let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        Self { points, tree, low, high }
    }

    /// The diagonal of the cloud's box.
    pub(super) fn size(&self) -> f64 {
        (self.high - self.low).length()
    }

    /// No gap is smaller than that of the boxes.
    pub(super) fn at_least(&self, other: &Self) -> f64 {
        (self.low - other.high).max(other.low - self.high).max(DVec3::ZERO).length()
    }

    /// Distance from a point to the cloud, infinite from none.
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        self.tree.one(p).map_or(f64::INFINITY, |n| n.distance())
    }

    /// The gap between two clouds: the 1st percentile of the distances from one's points to the other.
    pub(super) fn gap(&self, other: &Self) -> f64 {
        let mut distances: Vec<f64> =
            other.points.iter().filter_map(|p| self.tree.one(*p)).map(|n| n.distance()).collect();
        if distances.is_empty() {
            return f64::INFINITY;
        }
        let k = ((distances.len() - 1) as f64 * PERCENTILE).round() as usize;
        *distances.select_nth_unstable_by(k, f64::total_cmp).1
    }
}
