//! A related species refined on a handful of organs (paper supp. "Sensitivity to dataset size").
//!
//! Shape and bends are each a normal distribution of which the related species' mean and covariance are the prior,
//! worth so many organs; few organs shift it a little, many replace it.

use nalgebra::{DMatrix, DVector};

use super::deform::{Belief, Components, LearnError, Taught};
use super::lesson::Lesson;
use super::pca::{Pca, Prior};
use super::shape::broadened;
use super::smooth::smooth;
use crate::model::Species;

/// Organs that the related species' mean and spread are worth (a guess; leaves of one plant are no independent
/// observations, and a seedling soybean has a dozen).
const PRIOR_ORGANS: f64 = 20.0;

/// The species that raw organs of a relative are fitted with: smooth bends, and shapes that may leave its own.
///
/// # Errors
/// [`LearnError`] when a basis is refused.
pub fn rich_in_shape(from: &Species) -> Result<Species, LearnError> {
    let mut rich = smooth(from)?;
    rich.leaf.shape = broadened(&from.leaf.shape, from.leaf.shape.mean(), 1.0)?;
    Ok(rich.sealed()?)
}

/// What `lessons` make of the related species `from`, with as many components as it has.
///
/// # Errors
/// [`LearnError`] without a single blade, or when a basis cannot be had.
pub fn adapted(lessons: &[Lesson], from: &Species) -> Result<Taught, LearnError> {
    let shapes: Vec<_> = lessons.iter().flat_map(|l| &l.shapes).map(DVector::transpose).collect();
    if shapes.is_empty() {
        return Err(LearnError::NoBlades);
    }
    let prior = Prior { basis: &from.leaf.shape, mean_samples: PRIOR_ORGANS, spread_samples: PRIOR_ORGANS };
    let shape = Pca::adapted(prior, &DMatrix::from_rows(&shapes), from.leaf.shape.rank())?.basis;
    let bends = [&from.leaf.deform, &from.stem.deform];
    let components = Components { leaf: bends[0].rank(), stem: bends[1].rank() };
    let kinship = bends.map(|basis| Belief::Kin(basis, PRIOR_ORGANS));
    Ok(Taught { shape, ..Taught::believing(lessons, from, components, kinship)? })
}
