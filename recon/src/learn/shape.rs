//! A species' leaf shapes: the principal components of its leaves' grids, and what they are worth on other leaves.

use glam::DVec2;
use nalgebra::{DMatrix, DVector, RowDVector};

use super::contour::distance;
use super::harmonic::harmonic;
use super::outline::{Outline, OutlineError, resampled};
use super::oval::oval;
use super::pca::{Pca, PcaError, Prior, folds, principal};
use super::smooth::shape_modes;
use crate::model::leaf::{COLUMNS, ROWS, node};
use crate::model::{Basis, Knots, refine};

/// Steps of the Catmull-Rom curve between two rows in [`contour_error`]: the edge of the leaf's refined surface.
const EDGE_STEPS: usize = 4;
/// Share of a species' leaves that must be oval for it to count as oval. Both kinds of grid in one basis would put a node
/// in two places, so the few others are left out.
const OVAL_SHARE: f64 = 0.95;
/// With fewer scans than this a related species' components stand beside the scans' own deviations (a guess: three scans
/// a component).
pub const FEW_SCANS: usize = 30;
/// Scans that a related species' σ and components are worth beside few scans: as many as end their need. Their mean is
/// worth none, because even one leaf tells more of its species' mean shape.
const RELATED_SCANS: f64 = FEW_SCANS as f64;

/// The share of smooth changes that a species of few scans keeps beside a relative's components: another species' leaves
/// vary in other ways too, and at this share (a guess) the narrowest leaf within 3 σ is still a leaf.
pub const UNSEEN: f64 = 0.5;

/// How an outline becomes a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GridKind {
    /// Equal steps between the crossings of each row's line.
    Oval,
    /// Harmonic coordinates.
    Harmonic,
}

impl GridKind {
    /// The kind for a species: oval when nearly all of its leaves are.
    #[must_use]
    pub fn of(outlines: &[&Outline]) -> Self {
        let ovals = outlines.iter().filter(|outline| oval(outline).is_ok()).count() as f64;
        if ovals >= OVAL_SHARE * outlines.len() as f64 { Self::Oval } else { Self::Harmonic }
    }

    /// The grid `[45*43]` of an outline.
    ///
    /// # Errors
    /// [`OutlineError`] when the outline has none of this kind.
    pub fn grid(self, outline: &Outline) -> Result<Vec<DVec2>, OutlineError> {
        match self {
            Self::Oval => oval(outline),
            Self::Harmonic => harmonic(outline),
        }
    }
}

/// A leaf to learn from: its outline and its flat grid `[45*43]`.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatLeaf {
    /// The contour.
    pub outline: Outline,
    /// The grid.
    pub grid: Vec<DVec2>,
}

impl FlatLeaf {
    /// The leaf of an outline.
    ///
    /// # Errors
    /// [`OutlineError`] when the outline has no grid of this kind.
    pub fn new(outline: &Outline, kind: GridKind) -> Result<Self, OutlineError> {
        Ok(Self { grid: kind.grid(outline)?, outline: outline.clone() })
    }

    /// Mean width of the rows, leaf lengths.
    #[must_use]
    pub fn width(&self) -> f64 {
        (0..ROWS).map(|i| self.grid[node(i, 0)].distance(self.grid[node(i, COLUMNS - 1)])).sum::<f64>() / ROWS as f64
    }

    /// The same leaf `factor` times as wide.
    #[must_use]
    pub fn widened(&self, factor: f64) -> Self {
        let grid = self.grid.iter().map(|p| DVec2::new(p.x * factor, p.y)).collect();
        Self { outline: self.outline.widened(factor), grid }
    }

    /// The leaf as outputs of the leaf model: x and y of each node, interleaved; likewise its mirror image, so that a
    /// species' mean is symmetric and each leaf teaches both sides.
    fn outputs(&self) -> [RowDVector<f64>; 2] {
        let row = |place: &dyn Fn(usize) -> DVec2| {
            RowDVector::from_iterator(2 * self.grid.len(), (0..self.grid.len()).flat_map(|n| place(n).to_array()))
        };
        let across = |n: usize| self.grid[node(n / COLUMNS, COLUMNS - 1 - n % COLUMNS)];
        [row(&|n| self.grid[n]), row(&|n| DVec2::new(-across(n).x, across(n).y))]
    }
}

/// Divides out each grass leaf's width (the model's s_x), so that s_x = 1 is the mean width.
#[must_use]
pub fn equally_wide(leaves: &[FlatLeaf]) -> Vec<FlatLeaf> {
    let mean = leaves.iter().map(FlatLeaf::width).sum::<f64>() / leaves.len().max(1) as f64;
    leaves.iter().map(|leaf| leaf.widened(mean / leaf.width())).collect()
}

/// A grass's shapes without what they say of the width, for a `related` species whose blades were not equally wide.
///
/// # Errors
/// [`PcaError`] when nothing but the width varies.
pub fn widthless(shapes: &Basis) -> Result<Basis, PcaError> {
    // The output's derivative by s_x: x where x stands, 0 where y does.
    let mut by_width = shapes.mean().clone();
    by_width.iter_mut().skip(1).step_by(2).for_each(|y| *y = 0.0);
    let by_width = by_width.normalize();
    let modes = DMatrix::from_diagonal(shapes.sigma()) * shapes.components();
    let rest = &modes - (&modes * &by_width) * by_width.transpose();
    Ok(principal(shapes.mean().clone(), &rest, shapes.rank())?.basis)
}

/// The mean grid `[45*43*2]` of leaves and their mirror images.
#[must_use]
pub fn mean(leaves: &[FlatLeaf]) -> DVector<f64> {
    let rows: Vec<RowDVector<f64>> = leaves.iter().flat_map(FlatLeaf::outputs).collect();
    rows.iter().map(RowDVector::transpose).sum::<DVector<f64>>() / rows.len().max(1) as f64
}

/// Shapes about a `mean` that vary as `shapes` do and besides by a `share` of the smooth changes of width and outline that
/// raw leaves are fitted with (`smooth::shape_modes`).
///
/// # Errors
/// [`PcaError`] when the basis is refused.
pub fn broadened(shapes: &Basis, mean: &DVector<f64>, share: f64) -> Result<Basis, PcaError> {
    let own = DMatrix::from_diagonal(shapes.sigma()) * shapes.components();
    let smooth = shape_modes(mean).into_iter().map(|mode| mode * share);
    let rows: Vec<_> = own.row_iter().map(|row| row.into_owned()).chain(smooth).collect();
    Ok(principal(mean.clone(), &DMatrix::from_rows(&rows), rows.len())?.basis)
}

/// The shapes of a species from its leaves and their mirror images, at most `components` of them; with fewer than
/// [`FEW_SCANS`] leaves the `related` species' components are pooled with the leaves' own deviations.
///
/// # Errors
/// [`PcaError`] when the leaves hold no variance and no related species has any.
pub fn learn(leaves: &[&FlatLeaf], related: &Basis, components: usize) -> Result<Pca, PcaError> {
    let rows: Vec<RowDVector<f64>> = leaves.iter().flat_map(|leaf| leaf.outputs()).collect();
    if rows.is_empty() {
        return Err(PcaError::Samples { expected: 1, found: 0 });
    }
    let samples = DMatrix::from_rows(&rows);
    if leaves.len() < FEW_SCANS {
        let prior = Prior { basis: related, mean_samples: 0.0, spread_samples: RELATED_SCANS };
        Pca::adapted(prior, &samples, components)
    } else {
        Pca::new(&samples, components)
    }
}

/// For 0 to `components` components the [`contour_error`] of every leaf, each under the shapes learned from the other
/// folds: `[components + 1][leaves]`.
///
/// # Errors
/// [`PcaError`] as [`learn`].
pub fn left_out(
    leaves: &[FlatLeaf],
    related: &Basis,
    components: usize,
    fold_count: usize,
) -> Result<Vec<Vec<f64>>, PcaError> {
    let mut errors = vec![vec![0.0; leaves.len()]; components + 1];
    for (rest, held) in folds(leaves.len(), fold_count) {
        let rest: Vec<&FlatLeaf> = rest.into_iter().map(|i| &leaves[i]).collect();
        let basis = learn(&rest, related, components)?.basis;
        for i in held {
            let [output, _] = leaves[i].outputs();
            let beta = basis.project(&output.transpose());
            for (k, errors) in errors.iter_mut().enumerate() {
                errors[i] = contour_error(&leaves[i].outline, &grid_of(&basis.at(&beta[..k.min(beta.len())])));
            }
        }
    }
    Ok(errors)
}

/// Mean distance, both ways, between an outline and the edge of a grid's surface, in leaf lengths.
#[must_use]
pub fn contour_error(outline: &Outline, grid: &[DVec2]) -> f64 {
    let side = |column: usize| {
        let nodes: Vec<_> = (0..ROWS).map(|i| grid[node(i, column)].extend(0.0)).collect();
        let curve: Vec<DVec2> = refine(&nodes, EDGE_STEPS, Knots::Uniform).iter().map(|p| p.truncate()).collect();
        resampled(&curve)
    };
    let edge: Vec<DVec2> = side(COLUMNS - 1).into_iter().chain(side(0).into_iter().rev()).collect();
    let truth = outline.polygon();
    let mean = |from: &[DVec2], to: &[DVec2]| from.iter().map(|p| distance(to, *p)).sum::<f64>() / from.len() as f64;
    (mean(&truth, &edge) + mean(&edge, &truth)) / 2.0
}

fn grid_of(output: &DVector<f64>) -> Vec<DVec2> {
    output.as_slice().chunks_exact(2).map(|p| DVec2::new(p[0], p[1])).collect()
}
