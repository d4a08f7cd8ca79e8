//! Where a picture shows the blade of a leaf instance: from its base across its pixels to its far end.

use demeter_frame::Intrinsics;
use glam::{DMat3, DVec2, DVec3};

use crate::fit::{NODES, Pictured};
use crate::organs::OrganCloud;
use crate::statistics::quantile;

/// Shares of the pixels across that are taken for a blade's edges, and along for its far end: strays lie beyond.
const EDGES: [f64; 2] = [0.01, 0.99];
const END: f64 = 0.995;
/// Fewest pixels across which edges can be told.
const MIN_PIXELS: usize = 3;
/// Standard deviation of a node's depth by a network, in lengths of the blade (a guess).
const DEPTH: f64 = 0.15;

/// The nodes of the blade that an organ's points are of, in the camera's frame where `base` is too, its axis from the
/// base to the middle of its far end. Depth is the plane through the points. `None` where the base or the points are no
/// picture of a blade.
#[must_use]
pub fn shown(organ: &OrganCloud, base: DVec3, camera: &Intrinsics) -> Option<Pictured> {
    let pixels: Vec<DVec2> = organ.points.iter().filter_map(|p| camera.project(*p)).collect();
    let foot = camera.project(base)?;
    if pixels.len() < MIN_PIXELS * NODES.rows() || pixels.len() != organ.points.len() {
        return None;
    }
    let middle = pixels.iter().sum::<DVec2>() / pixels.len() as f64;
    let axis = (middle - foot).try_normalize()?;
    let along: Vec<f64> = pixels.iter().map(|p| (*p - foot).dot(axis)).collect();
    let across: Vec<f64> = pixels.iter().map(|p| (*p - foot).perp_dot(axis)).collect();
    let length = quantile(&along, END)?;
    let depth = Plane::through(&pixels, &organ.points)?;
    let (rows, columns) = (NODES.rows(), NODES.columns());
    let band = length / (rows - 1) as f64;
    let mut nodes = Vec::with_capacity(rows * columns);
    let mut last = [0.0, 0.0];
    for row in 0..rows {
        let at = band * row as f64;
        let near: Vec<f64> =
            along.iter().zip(&across).filter(|(a, _)| (**a - at).abs() <= band / 2.0).map(|(_, c)| *c).collect();
        // Ends are points; a row without pixels is as wide as the one before.
        last = match row {
            0 => [0.0; 2],
            _ if near.len() < MIN_PIXELS => last,
            _ => [quantile(&near, EDGES[0])?, quantile(&near, EDGES[1])?],
        };
        let ends = if row + 1 == rows { [(last[0] + last[1]) / 2.0; 2] } else { last };
        for column in 0..columns {
            let share = column as f64 / (columns - 1) as f64;
            let aside = ends[0] + (ends[1] - ends[0]) * share;
            // perp_dot(axis) counts along the axis turned by a quarter the other way.
            let pixel = foot + axis * at - axis.perp() * aside;
            nodes.push(camera.unproject(pixel, depth.at(pixel)));
        }
    }
    let pixel = base.z / camera.fx;
    (pixel > 0.0 && nodes.iter().all(|p| p.is_finite() && p.z > 0.0)).then_some(Pictured { nodes, pixel, depth: DEPTH })
}

/// Depth as a linear function of the picture's coordinates, kept between the depths it was made of.
struct Plane {
    slope: DVec3,
    low: f64,
    high: f64,
}

impl Plane {
    fn through(pixels: &[DVec2], points: &[DVec3]) -> Option<Self> {
        let (mut h, mut g) = (DMat3::ZERO, DVec3::ZERO);
        for (pixel, point) in pixels.iter().zip(points) {
            let row = pixel.extend(1.0);
            h += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            g += row * point.z;
        }
        let slope = h.inverse() * g;
        let depths = || points.iter().map(|p| p.z);
        slope.is_finite().then(|| Self {
            slope,
            low: depths().fold(f64::INFINITY, f64::min),
            high: depths().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    fn at(&self, pixel: DVec2) -> f64 {
        self.slope.dot(pixel.extend(1.0)).clamp(self.low, self.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::OrganKind;

    /// Pixels of an ellipse on a plane that recedes to the right, its base at the left.
    fn leaf(camera: &Intrinsics) -> OrganCloud {
        let inside = |x: f64, y: f64| ((x - 100.0) / 60.0).powi(2) + ((y - 80.0) / 20.0).powi(2) <= 1.0;
        let at = (0..200).flat_map(|x| (0..160).map(move |y| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)));
        let points = at.filter(|p| inside(p.x, p.y)).map(|p| camera.unproject(p, 1.0 + 0.001 * p.x)).collect();
        OrganCloud { kind: OrganKind::Leaf, points, source: Vec::new() }
    }

    #[test]
    fn nodes_lie_on_the_outline_and_on_the_plane() {
        let camera = Intrinsics::from_hfov(200, 160, 1.0);
        let base = camera.unproject(DVec2::new(40.0, 80.0), 1.04);
        let shown = shown(&leaf(&camera), base, &camera).unwrap();
        let at = |row: usize, column: usize| camera.project(shown.nodes[row * NODES.columns() + column]).unwrap();
        let (rows, columns) = (NODES.rows(), NODES.columns());
        assert!(at(0, 3).distance(DVec2::new(40.0, 80.0)) < 1e-6);
        assert!(at(rows - 1, 0).distance(DVec2::new(160.0, 80.0)) < 6.0);
        let width = at(rows / 2, 0).distance(at(rows / 2, columns - 1));
        assert!((width - 40.0).abs() < 3.0, "{width}");
        assert!(shown.nodes.iter().all(|p| (p.z - 1.0 - 0.001 * camera.project(*p).unwrap().x).abs() < 5e-3));
    }

    #[test]
    fn what_is_no_picture_of_a_blade_shows_none() {
        let camera = Intrinsics::from_hfov(200, 160, 1.0);
        let good = leaf(&camera);
        assert!(shown(&good, DVec3::NEG_Z, &camera).is_none());
        for points in [vec![], vec![DVec3::Z; 9], vec![DVec3::Z; 900], vec![DVec3::NAN; 900]] {
            let organ = OrganCloud { points, ..good.clone() };
            assert!(shown(&organ, DVec3::new(0.1, 0.0, 1.0), &camera).is_none());
        }
    }
}
