//! Where a blade ends: at the line beside which lie as many points outside as are missing inside.
//!
//! Noise carries points over the edge and leaves gaps within it alike, so counting them is without bias, where
//! distances would draw the edge outwards with noise and inwards with sparse points.

use glam::DVec3;

use super::equations::Pulls;
use super::sheet::Sheet;
use crate::fit::loss::Loss;
use crate::model::leaf::Lattice;
use crate::statistics::quantile;

/// Least depth of the strip in which points are counted, in standard deviations of the points: at 2 noise carries less
/// than a hundredth of itself across the strip's inner line.
const DEPTH: f64 = 2.0;
/// Uncertainty of an edge that is no counting error, in blade lengths: teeth and what the basis cannot follow (a guess).
const RAGGED: f64 = 0.004;
/// Cost at which a pull gives up, in its own variances: an edge this far from where the points end is beside a hole.
const MOST: f64 = 6.0;
/// Share of places that may lie in holes or at the brink of one: the density of those above is the blade's.
const FULL: f64 = 0.75;
/// Share of that density below which a place is in a hole or at its brink.
const HOLE: f64 = 0.7;
/// Rows or columns inwards of a strip that tell a hole from an edge.
const GUARD: usize = 2;
/// Rows whose strips are counted together: single ones hold too few points for their scatter to be even.
const TOGETHER: usize = 3;

/// How edges are looked for.
#[derive(Clone, Copy)]
pub(super) struct Edges {
    /// Standard deviation of the points about the surface, metres.
    pub noise: f64,
    /// Length of the blade, metres.
    pub length: f64,
    /// Whether the base is an edge too, or hangs on its parent.
    pub base: bool,
}

/// Points counted on the area that nodes stand for.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Count {
    pub points: f64,
    /// Square metres.
    pub area: f64,
}

impl Count {
    fn and(self, other: Self) -> Self {
        Self { points: self.points + other.points, area: self.area + other.area }
    }

    /// Points per square metre.
    pub(super) fn density(self) -> f64 {
        self.points / self.area.max(f64::MIN_POSITIVE)
    }
}

/// A sheet with its counts.
struct Counted<'a> {
    sheet: &'a Sheet,
    counts: &'a [f64],
}

impl Counted<'_> {
    fn node(&self, n: usize) -> Count {
        Count { points: self.counts[n], area: self.sheet.areas[n] }
    }

    fn row(&self, row: usize, columns: impl Iterator<Item = usize>) -> Count {
        columns.map(|j| self.node(self.sheet.lattice.node(row, j))).fold(Count::default(), Count::and)
    }

    fn at(&self, row: usize, column: usize) -> DVec3 {
        self.sheet.points[self.sheet.lattice.node(row, column)]
    }

    /// What `inner` nodes hold outside holes.
    fn seen(&self, inner: &[usize]) -> Count {
        let columns = self.sheet.lattice.columns();
        let around = |n: usize| {
            let block = [n - columns, n, n + columns].into_iter().flat_map(|n| [n - 1, n, n + 1]);
            block.map(|n| self.node(n)).fold(Count::default(), Count::and).density()
        };
        let densities: Vec<f64> = inner.iter().map(|n| around(*n)).collect();
        let least = HOLE * quantile(&densities, FULL).unwrap_or(0.0);
        let seen = inner.iter().zip(densities).filter(|(_, density)| *density >= least).map(|(n, _)| self.node(*n));
        seen.fold(Count::default(), Count::and)
    }
}

impl Edges {
    /// Pulls the nodes of the sheet's edge; `counts` says how many points are nearest to each node.
    pub(super) fn pull(&self, sheet: &Sheet, counts: &[f64], pulls: &mut Pulls) {
        let lattice = sheet.lattice;
        let (rows, columns) = (lattice.rows(), lattice.columns());
        let counted = Counted { sheet, counts };
        let margin = self.margin(&counted);
        let Margin { deep, from, to } = &margin;
        let mut inner = counted.seen(&margin.inner(lattice));
        if inner.points <= 0.0 {
            inner = (0..counts.len()).map(|n| counted.node(n)).fold(Count::default(), Count::and);
        }
        let density = inner.density();
        if density <= 0.0 {
            return;
        }
        for i in 1..rows - 1 {
            let together = i.saturating_sub(TOGETHER / 2).max(1)..(i + TOGETHER / 2 + 1).min(rows - 1);
            for right in [false, true] {
                let column = |k: usize| if right { columns - 1 - k } else { k };
                let tangent = |i: usize| counted.at(i + 1, column(0)) - counted.at(i - 1, column(0));
                let strips = together.clone().map(|i| counted.row(i, (0..deep[i].min(columns / 2)).map(column)));
                let next = |i: usize| deep[i].min(columns / 2 - 1)..deep[i].min(columns / 2 - 1) + GUARD;
                let beside = together.clone().map(|i| counted.row(i, next(i).map(column)));
                let strip = Strip {
                    node: lattice.node(i, column(0)),
                    outwards: (counted.at(i, column(0)) - counted.at(i, column(1))).reject_from(tangent(i)),
                    width: together.clone().map(|i| tangent(i).length() / 2.0).sum(),
                    count: strips.fold(Count::default(), Count::and),
                    beside: beside.fold(Count::default(), Count::and),
                    shared: TOGETHER as f64,
                };
                self.pull_strip(&strip, density, pulls);
            }
        }
        let ends = [(rows - 1, rows - 2, *to..rows), (0, 1, 0..*from)];
        for (end, next, strip) in ends.into_iter().take(if self.base { 2 } else { 1 }) {
            let inside = if end == 0 { strip.end } else { strip.start }.clamp(GUARD, rows - GUARD);
            let guard = if end == 0 { inside..inside + GUARD } else { inside - GUARD..inside };
            let strip = Strip {
                node: lattice.node(end, columns / 2),
                outwards: counted.at(end, columns / 2) - counted.at(next, columns / 2),
                // An end is nearer to a triangle than to a strip, so a step of it adds half as much area.
                width: counted.at(inside, 0).distance(counted.at(inside, columns - 1)) / 2.0,
                count: strip.map(|i| counted.row(i, 0..columns)).fold(Count::default(), Count::and),
                beside: guard.map(|i| counted.row(i, 0..columns)).fold(Count::default(), Count::and),
                shared: 1.0,
            };
            self.pull_strip(&strip, density, pulls);
        }
    }

    /// What the blade holds inside its edges, holes and all; nothing when it is all edge.
    pub(super) fn inner(&self, sheet: &Sheet, counts: &[f64]) -> Count {
        let counted = Counted { sheet, counts };
        let inner = self.margin(&counted).inner(sheet.lattice);
        inner.into_iter().map(|n| counted.node(n)).fold(Count::default(), Count::and)
    }

    fn margin(&self, counted: &Counted<'_>) -> Margin {
        let (rows, columns) = (counted.sheet.lattice.rows(), counted.sheet.lattice.columns());
        let wide = |i: usize| counted.at(i, 0).distance(counted.at(i, columns - 1)) / (columns - 1) as f64;
        let long = |i: usize| counted.at(i, columns / 2).distance(counted.at(i + 1, columns / 2));
        Margin {
            deep: (0..rows).map(|i| self.deep(wide(i))).collect(),
            from: self.deep(long(0)).min(rows - 1),
            to: rows - self.deep(long(rows - 2)).min(rows - 1),
        }
    }

    /// How many nodes at distances of `step` metres, half a step of which is the first one's, make up a strip.
    fn deep(&self, step: f64) -> usize {
        (DEPTH * self.noise / step.max(f64::MIN_POSITIVE) + 0.5).ceil().clamp(2.0, 1e3) as usize
    }

    /// Moves the strip's node by the area that is missing over the strip's width.
    fn pull_strip(&self, strip: &Strip, density: f64, pulls: &mut Pulls) {
        let (expected, per_metre) = (strip.count.area * density, density * strip.width);
        let outwards = strip.outwards.normalize_or_zero();
        // Where nothing is seen inwards of the strip either, its points do not end there: it is beside a hole.
        if per_metre <= 0.0 || outwards == DVec3::ZERO || strip.beside.density() < HOLE * density {
            return;
        }
        let miss = (expected - strip.count.points) / per_metre;
        // By what is expected and not by what is found, or strips with few points would outweigh those with many.
        let counting = (expected + 1.0).sqrt() / per_metre;
        let sigma = counting.hypot(RAGGED * self.length) * strip.shared.sqrt();
        pulls.along(strip.node, outwards, miss, Loss::bounded(miss, sigma, MOST));
    }
}

/// Where the strips along the edge end.
struct Margin {
    /// Columns that each row's two strips take.
    deep: Vec<usize>,
    /// First row that is not the base's, first row that is the tip's.
    from: usize,
    to: usize,
}

impl Margin {
    /// Nodes of no strip.
    fn inner(&self, lattice: Lattice) -> Vec<usize> {
        let row = |i: usize| self.deep[i]..lattice.columns().saturating_sub(self.deep[i]);
        (self.from..self.to).flat_map(|i| row(i).map(move |j| lattice.node(i, j))).collect()
    }
}

/// A piece of the sheet along its edge.
struct Strip {
    /// The node that moves it.
    node: usize,
    /// Where it moves to.
    outwards: DVec3,
    /// Metres of edge.
    width: f64,
    count: Count,
    /// What lies next to it inwards.
    beside: Count,
    /// How many strips count the same points.
    shared: f64,
}
