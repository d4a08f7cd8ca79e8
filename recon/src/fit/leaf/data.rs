//! The points of one blade, prepared once.

use glam::DVec3;

use crate::fit::stem::median;
use crate::nearest::{Nearest, Neighbour};

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
        let stride = points.len().div_ceil(most).max(1);
        let points: Vec<DVec3> = points.iter().copied().step_by(stride).collect();
        let tree = Nearest::of(&points);
        let apart = |p: &DVec3| tree.k(*p, 8).last().map(Neighbour::distance);
        // Some of the points tell it well enough.
        let some = points.len().div_ceil(60);
        let spacing = median(points.iter().step_by(some.max(1)).filter_map(apart).collect()).unwrap_or(0.0).max(1e-6);
        Self { points, tree, spacing }
    }
}
