//! A blade's surface in the world while it is fitted: some of its control points with what they stand for.

use glam::DVec3;

use crate::model::leaf::Lattice;

/// The nodes of a lattice in the world.
pub(in crate::fit) struct Sheet {
    pub lattice: Lattice,
    pub points: Vec<DVec3>,
    /// Unit normals of the upper side, by central differences.
    pub normals: Vec<DVec3>,
    /// Area that each node stands for, square metres.
    pub areas: Vec<f64>,
}

impl Sheet {
    /// `points` are the lattice's, in the world.
    pub(in crate::fit) fn new(points: Vec<DVec3>, lattice: Lattice) -> Self {
        let (normals, areas) = (normals(&points, lattice), areas(&points, lattice));
        Self { lattice, points, normals, areas }
    }

    /// The node nearest to `p`, found by walking downhill from the nearest of a few nodes, or from `near`: much cheaper
    /// than a search tree, and as a point stays on its part of the blade while the blade moves, a folded blade's points
    /// do not leap to the other half.
    pub(in crate::fit) fn nearest(&self, p: DVec3, near: Option<usize>) -> usize {
        let (rows, columns) = (self.lattice.rows(), self.lattice.columns());
        let squared = |n: usize| self.points[n].distance_squared(p);
        let some = || (0..rows).step_by(3).flat_map(|row| (1..columns).step_by(3).map(move |j| row * columns + j));
        let start = near.or_else(|| some().min_by(|a, b| squared(*a).total_cmp(&squared(*b)))).unwrap_or(0);
        let (mut row, mut column) = (start / columns, start % columns);
        let mut least = squared(start);
        loop {
            let here = (row, column);
            for i in here.0.saturating_sub(1)..(here.0 + 2).min(rows) {
                for j in here.1.saturating_sub(1)..(here.1 + 2).min(columns) {
                    let distance = squared(i * columns + j);
                    if distance < least {
                        (least, row, column) = (distance, i, j);
                    }
                }
            }
            if (row, column) == here {
                return row * columns + column;
            }
        }
    }

    /// Derivative of the sum of the nodes' areas, each times a weight, by the place of each node.
    pub(in crate::fit) fn area_gradient(&self, weights: &[f64]) -> Vec<DVec3> {
        let mut gradient = vec![DVec3::ZERO; self.points.len()];
        for i in 0..self.lattice.rows() - 1 {
            for j in 0..self.lattice.columns() - 1 {
                let cell = cell(self.lattice, i, j);
                let [a, b, c, d] = cell.map(|n| self.points[n]);
                let weight = cell.into_iter().map(|n| weights[n]).sum::<f64>() / 4.0;
                let normal = (c - a).cross(d - b).normalize_or_zero() * (weight / 2.0);
                let (of_c, of_d) = ((d - b).cross(normal), normal.cross(c - a));
                for (n, by) in cell.into_iter().zip([-of_c, -of_d, of_c, of_d]) {
                    gradient[n] += by;
                }
            }
        }
        gradient
    }

    pub(in crate::fit) fn on_edge(&self, n: usize) -> bool {
        let (row, column) = (n / self.lattice.columns(), n % self.lattice.columns());
        row == 0 || row == self.lattice.rows() - 1 || column == 0 || column == self.lattice.columns() - 1
    }

    /// Height of the surface above `p`, which is nearest to node `n`, along the normal half way between the node and
    /// the foot of `p`: exact for a parabola, where the node's own normal would take its sag for a miss.
    pub(in crate::fit) fn height_above(&self, n: usize, p: DVec3) -> f64 {
        let columns = self.lattice.columns();
        let (row, column) = (n / columns, n % columns);
        let (down, up) =
            (if row > 0 { n - columns } else { n }, if row + 1 < self.lattice.rows() { n + columns } else { n });
        let (left, right) = (if column > 0 { n - 1 } else { n }, if column + 1 < columns { n + 1 } else { n });
        let miss = self.points[n] - p;
        let mut tilt = DVec3::ZERO;
        for (before, after) in [(down, up), (left, right)] {
            let along = self.points[after] - self.points[before];
            let share = -miss.dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
            // A foot beyond the edge has the edge's normal.
            let inside = if before == n {
                share.max(0.0)
            } else if after == n {
                share.min(0.0)
            } else {
                share
            };
            tilt += (self.normals[after] - self.normals[before]) * inside.clamp(-0.5, 0.5);
        }
        miss.dot((self.normals[n] + tilt / 2.0).normalize_or(self.normals[n]))
    }
}

fn normals(points: &[DVec3], lattice: Lattice) -> Vec<DVec3> {
    let (rows, columns) = (lattice.rows(), lattice.columns());
    let normal = |n: usize| {
        let (i, j) = ((n / columns).clamp(1, rows - 2), n % columns);
        let across = points[lattice.node(i, (j + 1).min(columns - 1))] - points[lattice.node(i, j.saturating_sub(1))];
        let along = points[lattice.node(i + 1, j)] - points[lattice.node(i - 1, j)];
        across.cross(along).normalize_or(DVec3::Z)
    };
    (0..points.len()).map(normal).collect()
}

/// The corners of a cell, in turn.
fn cell(lattice: Lattice, i: usize, j: usize) -> [usize; 4] {
    [lattice.node(i, j), lattice.node(i, j + 1), lattice.node(i + 1, j + 1), lattice.node(i + 1, j)]
}

/// A quarter of each cell's area to each of its corners.
fn areas(points: &[DVec3], lattice: Lattice) -> Vec<f64> {
    let mut areas = vec![0.0; points.len()];
    for i in 0..lattice.rows() - 1 {
        for j in 0..lattice.columns() - 1 {
            let cell = cell(lattice, i, j);
            let [a, b, c, d] = cell.map(|n| points[n]);
            let area = (c - a).cross(d - b).length() / 2.0;
            cell.into_iter().for_each(|n| areas[n] += area / 4.0);
        }
    }
    areas
}
