//! A related species refined on a handful of organs (paper supp. "Sensitivity to dataset size").
//!
//! Shape and bends are each a normal distribution of which the related species' mean and covariance are the prior,
//! worth so many organs; few organs shift it a little, many replace it.

use nalgebra::{DMatrix, DVector};

use super::deform::{Belief, LearnError, Taught, both_ways, mean, shared_out};
use super::displacement::Displacement;
use super::joints::{Hanging, priors};
use super::lesson::Lesson;
use super::mirror::{mirrored_leaf, mirrored_stem};
use super::pca::{Pca, Prior};
use super::smooth::{shape_modes, smooth};
use crate::model::{Basis, BasisError, Species};

/// Organs that the related species' mean and spread are worth (a guess; leaves of one plant are no independent
/// observations, and a seedling soybean has a dozen).
const PRIOR_ORGANS: f64 = 20.0;
/// A mode of which less than this share is new to a basis adds nothing.
const LEAST_NEW: f64 = 1e-3;

/// The species that raw organs of a relative are fitted with: smooth bends, and shapes that may leave its own.
///
/// # Errors
/// [`LearnError`] when a basis is refused.
pub fn rich_in_shape(from: &Species) -> Result<Species, LearnError> {
    let mut rich = smooth(from)?;
    rich.leaf.shape = widened(&from.leaf.shape)?;
    Ok(rich.sealed()?)
}

/// What `lessons` make of the related species `from`, with as many components as it has.
///
/// # Errors
/// [`LearnError`] without a single blade, or when a basis cannot be had.
pub fn adapted(lessons: &[Lesson], from: &Species) -> Result<Taught, LearnError> {
    let smooth = smooth(from)?;
    let shapes: Vec<_> = lessons.iter().flat_map(|l| &l.shapes).map(DVector::transpose).collect();
    if shapes.is_empty() {
        return Err(LearnError::NoBlades);
    }
    let prior = &from.leaf.shape;
    let shape = Pca::adapted(
        Prior { basis: prior, mean_samples: PRIOR_ORGANS, spread_samples: PRIOR_ORGANS },
        &DMatrix::from_rows(&shapes),
        prior.rank(),
    )?
    .basis;

    let leaves: Vec<&DVector<f64>> = lessons.iter().flat_map(|l| &l.leaves).collect();
    let coefficients = both_ways(&leaves, mirrored_leaf, &smooth.leaf.deform);
    let blocks = Displacement::of_leaf(&smooth, mean(&coefficients).ok_or(LearnError::NoBlades)?)?;
    let leaf = shared_out(&coefficients, &blocks, from.leaf.deform.rank(), kinship(&from.leaf.deform))?;

    let stems: Vec<&DVector<f64>> = lessons.iter().flat_map(|l| &l.stems).collect();
    let coefficients = both_ways(&stems, mirrored_stem, &smooth.stem.deform);
    let stem = match mean(&coefficients) {
        Some(at) => {
            let blocks = Displacement::of_stem(&smooth, &at)?;
            shared_out(&coefficients, &blocks, from.stem.deform.rank(), kinship(&from.stem.deform))?
        }
        None => from.stem.deform.clone(),
    };
    let hanging: Vec<Hanging> = lessons.iter().flat_map(|l| l.hanging.iter().copied()).collect();
    Ok(Taught { shape, leaf, stem, priors: priors(&hanging, &from.priors) })
}

/// The belief in a related species' bends. Every organ is there twice, as itself and in the mirror.
fn kinship(bends: &Basis) -> impl Fn(&Displacement) -> Result<Belief, BasisError> {
    move |block| Ok((block.of_basis(bends)?, 2.0 * PRIOR_ORGANS, 2.0 * PRIOR_ORGANS))
}

/// A shape basis with smooth modes added, as far as they are new to it.
fn widened(shape: &Basis) -> Result<Basis, BasisError> {
    let own = DMatrix::from_diagonal(shape.sigma()) * shape.components();
    let mut rows: Vec<_> = own.row_iter().map(|row| row.into_owned()).collect();
    for mode in shape_modes(shape.mean()) {
        let basis = Basis::from_modes(shape.mean().clone(), &DMatrix::from_rows(&rows))?;
        let known = basis.components().tr_mul(&(basis.components() * mode.transpose()));
        if (mode.transpose() - known).norm() > LEAST_NEW * mode.norm() {
            rows.push(mode);
        }
    }
    Basis::from_modes(shape.mean().clone(), &DMatrix::from_rows(&rows))
}
