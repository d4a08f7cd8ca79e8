//! The points of one blade, prepared once.

use glam::DVec3;

use crate::cloud::thinned;
use crate::nearest::{Nearest, Neighbour};
use crate::statistics::median;

/// Least standard deviation of points about a blade, as a share of its length: what a basis of a few dozen modes leaves
/// (a guess).
pub(in crate::fit) const NEAR: f64 = 0.002;
/// A node farther from every point than this many spacings of the points has no data beside it.
pub(in crate::fit) const BESIDE: f64 = 2.0;

/// Points with what the fit asks of them again and again.
pub(in crate::fit) struct Data {
    pub points: Vec<DVec3>,
    pub tree: Nearest,
    /// Distance to the seventh neighbour, the median over the points: what one cannot see between, metres.
    pub spacing: f64,
}

impl Data {
    /// At most `most` of the points, evenly.
    pub(in crate::fit) fn thinned(points: &[DVec3], most: usize) -> Self {
        let points = thinned(points, most);
        let tree = Nearest::of(&points);
        let apart = |p: &DVec3| tree.k(*p, 8).last().map(Neighbour::distance);
        // Some of the points tell it well enough.
        let some = points.len().div_ceil(60);
        let spacing = median(points.iter().step_by(some.max(1)).filter_map(apart)).unwrap_or(0.0).max(1e-6);
        Self { points, tree, spacing }
    }
}
