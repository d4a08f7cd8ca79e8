//! The grid of any leaf in one piece, lobed ones too: harmonic coordinates, which are one-to-one.
//!
//! The leaf is triangulated and mapped onto the disc with weights that are never negative, so the map is one-to-one
//! (Radó-Kneser-Choquet; discretely Tutte and Floater). Cotangents are such weights here, because the triangulation is
//! Delaunay; they make the map the finite element solution of Δu = Δv = 0.

use std::f64::consts::PI;

use glam::DVec2;
use nalgebra::DMatrix;
use nalgebra_sparse::factorization::CscCholesky;
use nalgebra_sparse::{CooMatrix, CscMatrix};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::contour::{area, contains, distance, is_simple};
use super::outline::{Outline, OutlineError};
use super::unfold::{folded, unfold};
use crate::model::leaf::{COLUMNS, POINTS, ROWS, Side, VEIN, node};

/// Points inside the leaf; the grid has 1,763.
const INNER_POINTS: f64 = 2000.0;

/// The grid `[45*43]` of harmonic coordinates (spec "Leaf template", b): node (i, j) is the inverse image of v = i/44,
/// u = 0.5 + (j/21 - 1) sqrt(v (1 - v)). The few cells that are coarser than the lobe they cross are
/// unfolded.
///
/// # Errors
/// [`OutlineError`] when the contour, at the grid's resolution, crosses itself or has no inside, or when cells stay
/// folded.
pub fn harmonic(outline: &Outline) -> Result<Vec<DVec2>, OutlineError> {
    let mesh = Mesh::of(boundary(outline))?;
    let mut grid = mesh.inverse(&mesh.to_disc()?);
    unfold(&mut grid);
    match folded(&grid) {
        0 => Ok(grid),
        found => Err(OutlineError::Folded { found }),
    }
}

/// The nodes of the grid's edge, counter-clockwise from the base: place in the leaf and on the disc. They alone bound the
/// leaf that is mapped, so that it is the leaf that the grid can show, and cells at the edge do not fold over what is
/// finer than they are.
fn boundary(outline: &Outline) -> Vec<(DVec2, DVec2)> {
    let place = |side: Side, i: usize| {
        let v = i as f64 / (ROWS - 1) as f64;
        let half = if side == Side::Right { half_width(v) } else { -half_width(v) };
        // The half circle from base to tip is as long as the side: v = (1 - cos πt) / 2 after a share t of it.
        (outline.at(side, (1.0 - 2.0 * v).acos() / PI), DVec2::new(0.5 + half, v))
    };
    let right = (0..ROWS - 1).map(|i| place(Side::Right, i));
    right.chain((1..ROWS).rev().map(|i| place(Side::Left, i))).collect()
}

/// Half the width of the disc of diameter 1 at height v.
fn half_width(v: f64) -> f64 {
    (v * (1.0 - v)).max(0.0).sqrt()
}

/// A leaf in triangles.
struct Mesh {
    /// First the boundary in order, then the inside row by row, which keeps the factor of the Laplacian sparse.
    points: Vec<DVec2>,
    /// Where the boundary goes on the disc.
    rim: Vec<DVec2>,
    /// Counter-clockwise.
    triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// Triangles between the boundary (counter-clockwise) and a lattice of [`INNER_POINTS`] points.
    fn of(boundary: Vec<(DVec2, DVec2)>) -> Result<Self, OutlineError> {
        let (polygon, rim): (Vec<DVec2>, Vec<DVec2>) = boundary.into_iter().unzip();
        if !is_simple(&polygon) {
            return Err(OutlineError::Crossed);
        }
        let mut points = polygon.clone();
        points.extend(lattice(&polygon));
        let mut triangulation = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
        for p in &points {
            // It refuses numbers that are not finite, and such that are too small to compute with.
            triangulation.insert(Point2::new(p.x, p.y)).or(Err(OutlineError::Degenerate))?;
        }
        if triangulation.num_vertices() != points.len() || points.len() == polygon.len() {
            return Err(OutlineError::Degenerate);
        }
        for i in 0..polygon.len() {
            let [from, to] = [i, (i + 1) % polygon.len()].map(FixedVertexHandle::from_index);
            triangulation.try_add_constraint(from, to);
            if !triangulation.exists_constraint(from, to) {
                return Err(OutlineError::Crossed);
            }
        }
        let triangles = triangulation.inner_faces().map(|face| face.vertices().map(|v| v.index()));
        let inside = |t: &[usize; 3]| contains(&polygon, t.iter().map(|v| points[*v]).sum::<DVec2>() / 3.0);
        let triangles = triangles.filter(inside).collect();
        Ok(Self { points, rim, triangles })
    }

    /// Harmonic coordinates of every point.
    fn to_disc(&self) -> Result<Vec<DVec2>, OutlineError> {
        let (rim, inner) = (self.rim.len(), self.points.len() - self.rim.len());
        let mut matrix = CooMatrix::new(inner, inner);
        let mut right = DMatrix::zeros(inner, 2);
        for (a, b, weight) in self.weights() {
            for (a, b) in [(a, b), (b, a)].into_iter().filter(|(a, _)| *a >= rim) {
                matrix.push(a - rim, a - rim, weight);
                if b >= rim {
                    matrix.push(a - rim, b - rim, -weight);
                } else {
                    right[(a - rim, 0)] += weight * self.rim[b].x;
                    right[(a - rim, 1)] += weight * self.rim[b].y;
                }
            }
        }
        let factor = CscCholesky::factor(&CscMatrix::from(&matrix)).or(Err(OutlineError::Degenerate))?;
        let inside = factor.solve(&right);
        let inside = (0..inner).map(|k| DVec2::new(inside[(k, 0)], inside[(k, 1)]));
        Ok(self.rim.iter().copied().chain(inside).collect())
    }

    /// Every triangle's edges with half the cotangent of the angle opposite; their sum over the two triangles of an edge
    /// is what must not be negative.
    fn weights(&self) -> Vec<(usize, usize, f64)> {
        let mut edges: Vec<(usize, usize, f64)> = Vec::with_capacity(3 * self.triangles.len());
        for t in &self.triangles {
            for k in 0..3 {
                let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
                let (to_a, to_b) = (self.points[a] - self.points[c], self.points[b] - self.points[c]);
                edges.push((a.min(b), a.max(b), to_a.dot(to_b) / to_a.perp_dot(to_b) / 2.0));
            }
        }
        edges.sort_by_key(|(a, b, _)| (*a, *b));
        edges
            .chunk_by(|one, two| (one.0, one.1) == (two.0, two.1))
            // Delaunay's condition says that the sum is at least 0; rounding may not.
            .map(|shared| (shared[0].0, shared[0].1, shared.iter().map(|edge| edge.2).sum::<f64>().max(0.0)))
            .collect()
    }

    /// The inverse images of the grid's nodes.
    fn inverse(&self, disc: &[DVec2]) -> Vec<DVec2> {
        let mut grid = vec![DVec2::ZERO; POINTS];
        // How far inside its triangle each node is: on a common edge the deeper triangle wins, the first if none.
        let mut depth = vec![f64::NEG_INFINITY; POINTS];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| disc[v]);
            let twice = (b - a).perp_dot(c - a);
            for (i, j) in nodes_within(a.min(b).min(c), a.max(b).max(c)) {
                let v = i as f64 / (ROWS - 1) as f64;
                let p = DVec2::new(0.5 + (j as f64 / VEIN as f64 - 1.0) * half_width(v), v);
                let weights = [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)];
                let weights = weights.map(|w| w / twice);
                let least = weights[0].min(weights[1]).min(weights[2]);
                if least > depth[node(i, j)] {
                    depth[node(i, j)] = least;
                    grid[node(i, j)] = (0..3).map(|k| self.points[t[k]] * weights[k]).sum();
                }
            }
        }
        grid[node(ROWS - 1, 0)..].fill(DVec2::Y);
        for i in 1..ROWS - 1 {
            grid[node(i, COLUMNS - 1)] = self.points[i];
            grid[node(i, 0)] = self.points[self.rim.len() - i];
        }
        grid
    }
}

/// The inner nodes of the grid in a rectangle of the disc, and a few around it.
fn nodes_within(low: DVec2, high: DVec2) -> impl Iterator<Item = (usize, usize)> {
    let rows = (ROWS - 1) as f64;
    let (first, last) = ((low.y * rows).floor().max(1.0) as usize, ((high.y * rows).ceil() as usize).min(ROWS - 2));
    (first..=last).flat_map(move |i| {
        let half = half_width(i as f64 / rows);
        let column = |u: f64| ((u - 0.5) / half + 1.0) * VEIN as f64;
        let last = (column(high.x).ceil() as usize).min(COLUMNS - 2);
        (column(low.x).floor().max(1.0) as usize..=last).map(move |j| (i, j))
    })
}

/// A hexagonal lattice inside a polygon, half a step off its edge: near-equilateral triangles.
fn lattice(polygon: &[DVec2]) -> Vec<DVec2> {
    let step = (area(polygon).abs() * 2.0 / (3f64.sqrt() * INNER_POINTS)).sqrt();
    let rise = step * 3f64.sqrt() / 2.0;
    let (low, high) = polygon.iter().fold((DVec2::MAX, DVec2::MIN), |(a, b), p| (a.min(*p), b.max(*p)));
    let mut points = Vec::new();
    if !(step > 0.0 && step.is_finite()) {
        return points;
    }
    for row in 0..((high.y - low.y) / rise) as usize + 1 {
        let y = low.y + (row as f64 + 0.5) * rise;
        let shift = if row % 2 == 0 { 0.25 } else { 0.75 };
        for column in 0..((high.x - low.x) / step) as usize + 1 {
            let p = DVec2::new(low.x + (column as f64 + shift) * step, y);
            if contains(polygon, p) && distance(polygon, p) >= step / 2.0 {
                points.push(p);
            }
        }
    }
    points
}
