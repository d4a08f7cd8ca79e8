//! What the points of a blade say of a sheet.

use glam::DVec3;

use super::data::Data;
use super::sheet::Sheet;
use crate::statistics::mean;

/// A sheet with the points that belong to each of its nodes.
pub(super) struct Seen {
    pub sheet: Sheet,
    /// The node nearest to each point.
    pub nodes: Vec<usize>,
    /// Points nearest to each node.
    pub counts: Vec<f64>,
    /// Height of the sheet above each point; of points beyond the edge too.
    pub heights: Vec<f64>,
}

impl Seen {
    /// `near` holds a node near each point, where one is known.
    pub(super) fn of(sheet: Sheet, data: &Data, near: Option<&[usize]>) -> Self {
        let mut counts = vec![0.0; sheet.points.len()];
        let (mut nodes, mut heights) = (Vec::with_capacity(data.points.len()), Vec::with_capacity(data.points.len()));
        for (i, p) in data.points.iter().enumerate() {
            let n = sheet.nearest(*p, near.map(|near| near[i]));
            counts[n] += 1.0;
            nodes.push(n);
            heights.push(sheet.height_above(n, *p));
        }
        Self { sheet, nodes, counts, heights }
    }

    /// Distance of each point: over the edge to the node there, above the sheet its height.
    pub(super) fn distances<'a>(&'a self, data: &'a Data) -> impl ExactSizeIterator<Item = f64> + 'a {
        data.points.iter().zip(&self.nodes).zip(&self.heights).map(|((p, n), height)| {
            if self.sheet.on_edge(*n) { self.sheet.points[*n].distance(*p) } else { height.abs() }
        })
    }

    /// The Chamfer distance by the sheet's nodes: means over the points and over the sheet's area, halved, metres.
    pub(super) fn chamfer(&self, data: &Data) -> f64 {
        let to_points = |n: usize| data.tree.one(self.sheet.points[n]).map_or(0.0, |found| found.distance());
        let areas = &self.sheet.areas;
        let back: f64 = areas.iter().enumerate().map(|(n, area)| area * to_points(n)).sum();
        let back = back / areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        (mean(self.distances(data)).unwrap_or(0.0) + back) / 2.0
    }

    /// The way to each node from the point nearest to it, where that is farther than `reach` metres, with the node.
    pub(super) fn gaps<'a>(&'a self, data: &'a Data, reach: f64) -> impl Iterator<Item = (usize, DVec3)> + 'a {
        let (rows, columns) = (self.sheet.lattice.rows(), self.sheet.lattice.columns());
        (0..rows).flat_map(move |i| (0..columns).map(move |j| (i, j))).filter_map(move |(i, j)| {
            let around = (i.saturating_sub(1)..(i + 2).min(rows))
                .flat_map(|i| (j.saturating_sub(1)..(j + 2).min(columns)).map(move |j| i * columns + j));
            // A search costs more than a look at the neighbours, which nearly always settles it.
            if around.into_iter().any(|n| self.counts[n] > 0.0) {
                return None;
            }
            let n = i * columns + j;
            let found = data.tree.one(self.sheet.points[n])?;
            (found.distance() > reach).then(|| (n, self.sheet.points[n] - data.points[found.index]))
        })
    }
}
