//! The area that a surface covers seen from above.

use glam::{DVec2, USizeVec2};

use crate::model::PlantMesh;

/// Cells along the longer side of the raster: the error is about a cell along the outline, for a plant 1 m across
/// with 10 m of outline 0.5 % of a square metre in all at most.
const CELLS: f64 = 1024.0;

/// Area in square metres of the union of all faces projected along z: cells whose centre lies under a face.
pub(super) fn area(mesh: &PlantMesh) -> f64 {
    let low = mesh.positions.iter().map(|p| p.truncate()).reduce(DVec2::min).unwrap_or_default();
    let high = mesh.positions.iter().map(|p| p.truncate()).reduce(DVec2::max).unwrap_or_default();
    let cell = (high - low).max_element() / CELLS;
    if !(cell > 0.0 && cell.is_finite()) {
        return 0.0;
    }
    let size = ((high - low) / cell).ceil().as_usizevec2() + USizeVec2::ONE;
    let mut covered = vec![false; size.x * size.y];
    for face in 0..mesh.faces.len() {
        // In cells, with the centres at whole numbers.
        let [a, b, c] = mesh.corners(face).map(|p| (p.truncate() - low) / cell - 0.5);
        let turn = (b - a).perp_dot(c - a);
        let (first, last) = (a.min(b).min(c).ceil(), a.max(b).max(c).floor());
        let (first, last) = (first.max(DVec2::ZERO).as_usizevec2(), last.max(DVec2::NEG_ONE) + 1.0);
        let last = last.as_usizevec2().min(size);
        for y in first.y..last.y {
            for x in first.x..last.x {
                let p = DVec2::new(x as f64, y as f64);
                let inside = |from: DVec2, to: DVec2| (to - from).perp_dot(p - from) * turn >= 0.0;
                if turn != 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
                    covered[y * size.x + x] = true;
                }
            }
        }
    }
    covered.iter().filter(|c| **c).count() as f64 * cell * cell
}
