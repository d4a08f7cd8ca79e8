//! Fewer points of the same shape: what costs more than a look at each point is done on these.

use glam::DVec3;

use crate::cloud::diagonal;

/// Rounds in which the cells find their size.
const ROUNDS: usize = 4;

/// Indices, ascending, of at most about `most` points: one a cell of a cubic lattice; all when there are no more.
/// Coordinates are finite.
pub(super) fn one_a_cell(points: &[DVec3], most: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = (0..points.len()).collect();
    let Some(low) = points.iter().copied().reduce(DVec3::min).filter(|_| points.len() > most) else { return chosen };
    // Plants are surfaces: as many cells are filled as their area holds, so their number goes with the size's square.
    let mut cell = diagonal(points).unwrap_or(0.0) / (most as f64).sqrt();
    for _ in 0..ROUNDS {
        let mut keys: Vec<([u32; 3], usize)> = (0..points.len())
            .map(|i| (((points[i] - low) / cell.max(f64::MIN_POSITIVE)).to_array().map(|x| x as u32), i))
            .collect();
        keys.sort_unstable();
        keys.dedup_by_key(|(key, _)| *key);
        let filled = keys.len();
        chosen = keys.into_iter().map(|(_, i)| i).collect();
        cell *= (filled as f64 / most as f64).sqrt();
    }
    chosen.sort_unstable();
    chosen
}
