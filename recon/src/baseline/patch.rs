//! Loose surfaces: one patch a set of points, with no idea of leaf or plant.

use glam::{DVec2, DVec3};
use nalgebra::{DMatrix, SMatrix, SVector};

use crate::axes::PrincipalAxes;
use crate::model::PlantMesh;
use crate::nearest::Nearest;
use crate::statistics::quantile;

/// Cells of a patch's mesh along its first and second axis.
const CELLS: (usize, usize) = (32, 20);
/// Rounds of finding neighbours and solving for the control points: the change is below 1 % long before (measured).
const ROUNDS: usize = 40;
/// Control points of a Bézier patch across its length; its length takes the rest.
const ACROSS: usize = 3;
/// Weight that holds control points to the middle of their neighbours, against one square for every point: enough to
/// keep the system regular where there is no data.
const STIFFNESS: f64 = 1e-4;

/// A Bézier surface of at least `numbers` free numbers fitted to points by both directions of the Chamfer distance;
/// empty when the points span nothing.
#[must_use]
pub fn bezier(points: &[DVec3], numbers: usize) -> PlantMesh {
    let Some(frame) = Frame::of(points) else { return PlantMesh::default() };
    let along = numbers.div_ceil(3 * ACROSS).max(2);
    let share = |k: usize, of: usize| k as f64 / (of - 1) as f64;
    let weights: Vec<Vec<f64>> = grid()
        .map(|(u, v)| {
            let (rows, columns) = (bernstein(along, u), bernstein(ACROSS, v));
            rows.iter().flat_map(|row| columns.iter().map(move |column| row * column)).collect()
        })
        .collect();
    let size = along * ACROSS;
    let start = (0..size).map(|k| frame.at(share(k / ACROSS, along), share(k % ACROSS, ACROSS), 0.0));
    let mut control: Vec<DVec3> = start.collect();
    let cloud = Nearest::of(points);
    for _ in 0..ROUNDS {
        let surface = surface(&weights, &control);
        let search = Nearest::of(&surface);
        let mut normal = DMatrix::<f64>::zeros(size, size);
        let mut sums = DMatrix::<f64>::zeros(size, 3);
        let mut pull = |sample: usize, to: DVec3, weight: f64| {
            let row = &weights[sample];
            for (i, a) in row.iter().enumerate() {
                for (j, b) in row.iter().enumerate() {
                    normal[(i, j)] += weight * a * b;
                }
                for (k, x) in to.to_array().into_iter().enumerate() {
                    sums[(i, k)] += weight * a * x;
                }
            }
        };
        for p in points {
            if let Some(found) = search.one(*p) {
                pull(found.index, *p, 1.0 / points.len() as f64);
            }
        }
        for (sample, x) in surface.iter().enumerate() {
            if let Some(found) = cloud.one(*x) {
                pull(sample, points[found.index], 1.0 / surface.len() as f64);
            }
        }
        stiffen(&mut normal, along);
        let Some(solved) = normal.cholesky().map(|factor| factor.solve(&sums)) else { break };
        control = (0..size).map(|i| DVec3::new(solved[(i, 0)], solved[(i, 1)], solved[(i, 2)])).collect();
    }
    sheet(surface(&weights, &control), |_| true)
}

/// Second differences of the control net, squared.
fn stiffen(normal: &mut DMatrix<f64>, along: usize) {
    let mut bend = |a: usize, b: usize, c: usize| {
        for (i, x) in [(a, 1.0), (b, -2.0), (c, 1.0)] {
            for (j, y) in [(a, 1.0), (b, -2.0), (c, 1.0)] {
                normal[(i, j)] += STIFFNESS * x * y;
            }
        }
    };
    for i in 0..along {
        bend(i * ACROSS, i * ACROSS + 1, i * ACROSS + 2);
        if i + 2 < along {
            (0..ACROSS).for_each(|j| bend(i * ACROSS + j, (i + 1) * ACROSS + j, (i + 2) * ACROSS + j));
        }
    }
}

/// The Bernstein polynomials of `count` control points at t.
fn bernstein(count: usize, t: f64) -> Vec<f64> {
    let mut values = vec![1.0];
    for _ in 1..count {
        let mut next = vec![0.0; values.len() + 1];
        for (k, value) in values.iter().enumerate() {
            next[k] += value * (1.0 - t);
            next[k + 1] += value * t;
        }
        values = next;
    }
    values
}

/// The surface z = a + bx + cy + dx² + exy + fy² over the plane that the points spread along, of the cells that have a
/// point within a cell's diagonal; empty when the points span nothing.
#[must_use]
pub fn quadratic(points: &[DVec3]) -> PlantMesh {
    let Some(frame) = Frame::of(points) else { return PlantMesh::default() };
    let terms = |p: DVec2| SVector::<f64, 6>::from([1.0, p.x, p.y, p.x * p.x, p.x * p.y, p.y * p.y]);
    let mut normal = SMatrix::<f64, 6, 6>::identity() * 1e-12;
    let mut sums = SVector::<f64, 6>::zeros();
    let local: Vec<DVec3> = points.iter().map(|p| frame.local(*p)).collect();
    for p in &local {
        let row = terms(p.truncate());
        normal += row * row.transpose();
        sums += row * p.z;
    }
    let Some(coefficients) = normal.cholesky().map(|factor| factor.solve(&sums)) else { return PlantMesh::default() };
    let place: Vec<DVec2> = grid().map(|(u, v)| frame.place(u, v)).collect();
    let cell = (frame.high - frame.low) / DVec2::new(CELLS.0 as f64, CELLS.1 as f64);
    let footprint = Nearest::of(&local.iter().map(|p| p.truncate().extend(0.0)).collect::<Vec<_>>());
    let seen = |p: DVec2| footprint.one(p.extend(0.0)).is_some_and(|found| found.distance() < cell.length());
    let height = |p: DVec2| terms(p).dot(&coefficients);
    let positions = place.iter().map(|p| frame.world(p.extend(height(*p)))).collect();
    sheet(positions, |quad| seen(quad.iter().map(|v| place[*v as usize]).sum::<DVec2>() / 4.0))
}

/// The box of a set of points along its principal axes.
struct Frame {
    axes: PrincipalAxes,
    low: DVec2,
    high: DVec2,
}

impl Frame {
    fn of(points: &[DVec3]) -> Option<Self> {
        let axes = PrincipalAxes::of(points.iter().copied());
        let mut frame = Self { axes, low: DVec2::ZERO, high: DVec2::ZERO };
        let local: Vec<DVec3> = points.iter().map(|p| frame.local(*p)).collect();
        let end = |share: f64| {
            let of = |value: fn(&DVec3) -> f64| quantile(local.iter().map(value), share);
            Some(DVec2::new(of(|p| p.x)?, of(|p| p.y)?))
        };
        (frame.low, frame.high) = (end(0.0)?, end(1.0)?);
        ((frame.high - frame.low).min_element() > 0.0).then_some(frame)
    }

    fn local(&self, p: DVec3) -> DVec3 {
        self.axes.axes.transpose() * (p - self.axes.centre)
    }

    fn world(&self, p: DVec3) -> DVec3 {
        self.axes.axes * p + self.axes.centre
    }

    fn place(&self, u: f64, v: f64) -> DVec2 {
        self.low + (self.high - self.low) * DVec2::new(u, v)
    }

    fn at(&self, u: f64, v: f64, height: f64) -> DVec3 {
        self.world(self.place(u, v).extend(height))
    }
}

/// The parameters of a patch's mesh vertices.
fn grid() -> impl Iterator<Item = (f64, f64)> {
    let (rows, columns) = CELLS;
    (0..=rows).flat_map(move |i| (0..=columns).map(move |j| (i as f64 / rows as f64, j as f64 / columns as f64)))
}

fn surface(weights: &[Vec<f64>], control: &[DVec3]) -> Vec<DVec3> {
    weights.iter().map(|row| row.iter().zip(control).map(|(weight, p)| *p * *weight).sum()).collect()
}

/// The mesh of a grid's vertices, of the cells that `keep` wants.
fn sheet(positions: Vec<DVec3>, keep: impl Fn(&[u32; 4]) -> bool) -> PlantMesh {
    let mut mesh = PlantMesh { positions, ..PlantMesh::default() };
    let (rows, columns) = CELLS;
    for i in 0..rows {
        for j in 0..columns {
            let vertex = |i: usize, j: usize| (i * (columns + 1) + j) as u32;
            let quad = [vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j)];
            if keep(&quad) {
                mesh.faces.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
            }
        }
    }
    mesh.organ_of_face = vec![0; mesh.faces.len()];
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::chamfer;

    /// A disc of radius 1 on the bowl z = 0.3 x² + 0.1 y², turned out of the axes.
    fn bowl() -> Vec<DVec3> {
        let at = |i: u32| {
            let (radius, angle) = ((f64::from(i) / 3_000.0).sqrt(), f64::from(i) * 2.399_963);
            let (x, y) = (radius * angle.cos() * 1.5, radius * angle.sin());
            DVec3::new(x, 0.3 * x * x + 0.1 * y * y, y)
        };
        (0..3_000).map(at).collect()
    }

    #[test]
    fn both_surfaces_find_a_bowl() {
        let cloud = bowl();
        // Samples of a 3,000-point cloud of 5 units² lie 0.02 units apart, 0.6 % of the diagonal.
        assert!(chamfer(&cloud, &quadratic(&cloud)).unwrap().cd < 0.006);
        let fine = chamfer(&cloud, &bezier(&cloud, 60)).unwrap().cd;
        assert!(fine < 0.012, "{fine}");
        let flat = chamfer(&cloud, &bezier(&cloud, 1)).unwrap().cd;
        assert!(flat > 2.0 * fine, "six control points cannot bend along the bowl: {flat} against {fine}");
    }

    #[test]
    fn points_that_span_nothing_have_no_surface() {
        for few in [vec![], vec![DVec3::ONE; 5], vec![DVec3::ZERO, DVec3::X]] {
            assert!(bezier(&few, 30).faces.is_empty() && quadratic(&few).faces.is_empty());
        }
    }
}
