//! Where a blade ends: at the line beside which lie as many points outside as are missing inside.
//!
//! Noise carries points over the edge and leaves gaps within it alike, so counting them is without bias, where
//! distances would draw the edge outwards with noise and inwards with sparse points.

use glam::DVec3;

use super::equations::Pulls;
use super::sheet::Sheet;
use crate::fit::loss::Loss;

/// Rows to either side over which the density beside a row's edge is taken.
const NEIGHBOURS: usize = 2;
/// Least depth of the strip in which points are counted, in standard deviations of the points: deeper, noise carries
/// nothing across its inner line that matters.
const DEPTH: f64 = 1.5;
/// Uncertainty of an edge that is no counting error, in blade lengths: teeth and what the basis cannot follow (a guess).
const RAGGED: f64 = 0.004;
/// Cost at which a pull gives up, in its own variances: an edge this far from where the points end is beside a hole.
const MOST: f64 = 9.0;
/// Share of the blade's mean density below which a place counts as not seen.
const SEEN: f64 = 0.25;

/// A place to which a node of the edge should move along one direction.
struct Goal {
    node: usize,
    direction: DVec3,
    place: DVec3,
    /// Standard deviation, metres.
    sigma: f64,
}

/// The goals of a blade's edge, found once and then kept while the surface moves.
pub(super) struct Edges {
    goals: Vec<Goal>,
}

/// Points counted on the area that nodes stand for.
#[derive(Clone, Copy, Default)]
struct Count {
    points: f64,
    area: f64,
}

impl Count {
    fn and(self, other: Self) -> Self {
        Self { points: self.points + other.points, area: self.area + other.area }
    }

    fn density(self) -> f64 {
        self.points / self.area.max(f64::MIN_POSITIVE)
    }
}

impl Edges {
    /// `nearest` holds for each node how many points are nearest to it, `noise` the points' standard deviation about
    /// the surface and `length` that of the blade, both in metres.
    pub(super) fn find(sheet: &Sheet, nearest: &[f64], noise: f64, length: f64, base_moves: bool) -> Self {
        let lattice = sheet.lattice;
        let (rows, columns) = (lattice.rows(), lattice.columns());
        let middle = columns / 2;
        let count = |row: usize, columns: &mut dyn Iterator<Item = usize>| {
            columns
                .map(|j| lattice.node(row, j))
                .fold(Count::default(), |sum, n| sum.and(Count { points: nearest[n], area: sheet.areas[n] }))
        };
        let all = (0..rows).fold(Count::default(), |sum, row| sum.and(count(row, &mut (0..columns))));
        let mut goals = Vec::new();
        let mut add = |node: usize, outwards: DVec3, width: f64, strip: Count, beside: Count| {
            let density = beside.density();
            if density < SEEN * all.density() {
                return;
            }
            let per_metre = (density * width).max(f64::MIN_POSITIVE);
            let shift = strip.points / per_metre - strip.area / width.max(f64::MIN_POSITIVE);
            let counting = (strip.points + 1.0).sqrt() / per_metre;
            let sigma = counting.hypot(RAGGED * length);
            goals.push(Goal { node, direction: outwards, place: sheet.points[node] + outwards * shift, sigma });
        };
        let at = |row: usize, column: usize| sheet.points[lattice.node(row, column)];
        // How many columns in from each side make the strip, by row.
        let deep: Vec<usize> = (0..rows)
            .map(|i| {
                let step = at(i, 0).distance(at(i, columns - 1)) / (columns - 1) as f64;
                (DEPTH * noise / step.max(f64::MIN_POSITIVE)).ceil().clamp(2.0, middle as f64) as usize
            })
            .collect();
        for i in 1..rows - 1 {
            let around = i.saturating_sub(NEIGHBOURS).max(1)..(i + NEIGHBOURS + 1).min(rows - 1);
            let inner =
                around.fold(Count::default(), |sum, row| sum.and(count(row, &mut (deep[row]..columns - deep[row]))));
            let beside = if inner.area > 0.0 { inner } else { all };
            for right in [false, true] {
                let column = |k: usize| if right { columns - 1 - k } else { k };
                let strip = count(i, &mut (0..deep[i]).map(column));
                let tangent = at(i + 1, column(0)) - at(i - 1, column(0));
                let across = at(i, column(0)) - at(i, column(1));
                let along = tangent.normalize_or_zero();
                let outwards = across.reject_from(tangent).normalize_or_zero();
                if along == DVec3::ZERO || !outwards.is_finite() || outwards == DVec3::ZERO {
                    continue;
                }
                add(lattice.node(i, column(0)), outwards, tangent.length() / 2.0, strip, beside);
            }
        }
        // The tip, and the base where it may move: the same with whole rows.
        for tip in [true, false] {
            if !tip && !base_moves {
                continue;
            }
            let row = |k: usize| if tip { rows - 1 - k } else { k };
            let step = at(row(0), middle).distance(at(row(1), middle));
            let depth = (DEPTH * noise / step.max(f64::MIN_POSITIVE)).ceil().clamp(2.0, rows as f64 / 4.0) as usize;
            let strip = (0..depth).fold(Count::default(), |sum, k| sum.and(count(row(k), &mut (0..columns))));
            let beside =
                (depth..2 * depth + 2).fold(Count::default(), |sum, k| sum.and(count(row(k), &mut (0..columns))));
            let width = at(row(depth), 0).distance(at(row(depth), columns - 1));
            let outwards = (at(row(0), middle) - at(row(1), middle)).normalize_or_zero();
            if outwards != DVec3::ZERO {
                add(lattice.node(row(0), middle), outwards, width, strip, beside);
            }
        }
        Self { goals }
    }

    pub(super) fn pull(&self, sheet: &Sheet, pulls: &mut Pulls) {
        for goal in &self.goals {
            let miss = (sheet.points[goal.node] - goal.place).dot(goal.direction);
            pulls.along(goal.node, goal.direction, miss, Loss::bounded(miss, goal.sigma, MOST));
        }
    }
}
