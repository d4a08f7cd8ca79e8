//! Deformation bases and articulation priors from clouds of organs (paper 3.2): shape and raw joint angles of each
//! organ first, their principal components then, and both once more within what was learned.

use nalgebra::{DMatrix, DVector};

use super::displacement::Displacement;
use super::joints::{Hanging, priors};
use super::lesson::Lesson;
use super::mirror::{mirrored_leaf, mirrored_stem};
use super::pca::{Pca, PcaError, Prior};
use super::smooth::smooth;
use crate::model::leaf::LeafModel;
use crate::model::species::SpeciesError;
use crate::model::{Basis, BasisError, Priors, Species};

/// What the smooth modes are worth beside the samples, as a share of their number: real organs bend in ways that a few
/// scans or a generator do not show, and a basis without them could not follow. With a tenth, real leaves are at the
/// bound of 3 σ three times as often as with as many as there are samples.
const SMOOTH_SHARE: f64 = 1.0;

/// Why nothing is learned.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// Principal components.
    #[error(transparent)]
    Pca(#[from] PcaError),
    /// The learned basis was refused.
    #[error(transparent)]
    Basis(#[from] BasisError),
    /// The learned species was refused.
    #[error(transparent)]
    Species(#[from] SpeciesError),
    /// Control points that do not tell how bends move them.
    #[error("expected organs whose points move when they bend, found none")]
    Still,
    /// No blade was good enough.
    #[error("expected at least one blade to learn from, found none")]
    NoBlades,
}

/// How many components to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Components {
    /// Of blades.
    pub leaf: usize,
    /// Of stems.
    pub stem: usize,
}

/// What lessons teach together.
#[derive(Clone, Debug)]
pub struct Taught {
    /// Blades' flat grids.
    pub shape: Basis,
    /// Blades' joint angles.
    pub leaf: Basis,
    /// Stems' joint angles.
    pub stem: Basis,
    /// How organs hang.
    pub priors: Priors,
}

impl Taught {
    /// Learns from `lessons`; what they do not speak of stays as `from` has it.
    ///
    /// # Errors
    /// [`LearnError`] without a single blade, or when a basis cannot be had.
    pub fn new(lessons: &[Lesson], from: &Species, components: Components) -> Result<Self, LearnError> {
        Self::believing(lessons, from, components, [Belief::Smooth; 2])
    }

    /// The same with what is believed of blades' and of stems' bends before any is seen.
    pub(super) fn believing(
        lessons: &[Lesson],
        from: &Species,
        components: Components,
        [of_blades, of_stems]: [Belief<'_>; 2],
    ) -> Result<Self, LearnError> {
        let smooth = smooth(from)?;
        let leaves: Vec<&DVector<f64>> = lessons.iter().flat_map(|l| &l.leaves).collect();
        let stems: Vec<&DVector<f64>> = lessons.iter().flat_map(|l| &l.stems).collect();
        let hanging: Vec<Hanging> = lessons.iter().flat_map(|l| l.hanging.iter().copied()).collect();
        let leaf = leaf_basis(&leaves, &smooth, components.leaf, of_blades)?;
        let stem = match stems.as_slice() {
            [] => from.stem.deform.clone(),
            stems => stem_basis(stems, &smooth, components.stem, of_stems)?,
        };
        Ok(Self { shape: from.leaf.shape.clone(), leaf, stem, priors: priors(&hanging, &from.priors) })
    }

    /// `from` with what was learned.
    ///
    /// # Errors
    /// [`SpeciesError`] when it is refused.
    pub fn species(self, from: &Species, provenance: String) -> Result<Species, SpeciesError> {
        let mut species = from.clone();
        species.provenance = provenance;
        species.priors = self.priors;
        species.leaf = LeafModel { shape: self.shape, deform: self.leaf };
        species.stem.deform = self.stem;
        species.sealed()
    }
}

/// The species whose bends raw angles are fitted with: the smooth modes, or, once `lessons` were learned from, as many
/// components of what they taught (the disentangling's second round).
///
/// # Errors
/// [`LearnError`] as [`Taught::new`].
pub fn rich(from: &Species, lessons: &[Lesson]) -> Result<Species, LearnError> {
    let smooth = smooth(from)?;
    if lessons.iter().all(|l| l.leaves.is_empty()) {
        return Ok(smooth);
    }
    let components = Components { leaf: smooth.leaf.deform.rank(), stem: smooth.stem.deform.rank() };
    Ok(Taught::new(lessons, from, components)?.species(from, from.provenance.clone())?)
}

/// The blades' basis of `components` modes.
pub(super) fn leaf_basis(
    leaves: &[&DVector<f64>],
    smooth: &Species,
    components: usize,
    belief: Belief<'_>,
) -> Result<Basis, LearnError> {
    let coefficients = both_ways(leaves, mirrored_leaf, &smooth.leaf.deform);
    let mean = mean(&coefficients).ok_or(LearnError::NoBlades)?;
    shared_out(&coefficients, &Displacement::of_leaf(smooth, mean)?, components, belief)
}

/// The stems' basis of `components` modes.
pub(super) fn stem_basis(
    stems: &[&DVector<f64>],
    smooth: &Species,
    components: usize,
    belief: Belief<'_>,
) -> Result<Basis, LearnError> {
    let coefficients = both_ways(stems, mirrored_stem, &smooth.stem.deform);
    let mean = mean(&coefficients).unwrap_or_default();
    shared_out(&coefficients, &Displacement::of_stem(smooth, &mean)?, components, belief)
}

/// What is believed of bends before any is seen.
#[derive(Clone, Copy)]
pub(super) enum Belief<'a> {
    /// Smooth modes about the samples' own mean.
    Smooth,
    /// Mean and spread of a related species' bends, worth so many organs.
    Kin(&'a Basis, f64),
}

impl Belief<'_> {
    /// The belief as a basis of displacements with the samples that its mean and its spread are worth beside so many.
    fn worth(self, block: &Displacement, samples: usize) -> Result<(Basis, f64, f64), BasisError> {
        Ok(match self {
            Self::Smooth => (block.prior()?, 0.0, SMOOTH_SHARE * samples as f64),
            // Every organ is there twice, as itself and in the mirror.
            Self::Kin(bends, organs) => (block.of_basis(bends)?, 2.0 * organs, 2.0 * organs),
        })
    }
}

/// The basis of `components` modes, shared out among the blocks by their σ, at least one each.
fn shared_out(
    coefficients: &[Vec<f64>],
    blocks: &[Displacement],
    components: usize,
    belief: Belief<'_>,
) -> Result<Basis, LearnError> {
    let learn = |block: &Displacement, components: usize| {
        let rows: Vec<_> = coefficients.iter().map(|c| block.of_coefficients(c).transpose()).collect();
        let (basis, mean_samples, spread_samples) = belief.worth(block, coefficients.len())?;
        let prior = Prior { basis: &basis, mean_samples, spread_samples };
        Ok::<Pca, LearnError>(Pca::adapted(prior, &DMatrix::from_rows(&rows), components)?)
    };
    let whole = blocks.iter().map(|block| learn(block, block.rank())).collect::<Result<Vec<Pca>, _>>()?;
    let mut sigmas: Vec<f64> = whole.iter().flat_map(|pca| pca.basis.sigma().iter().copied()).collect();
    sigmas.sort_by(|a, b| b.total_cmp(a));
    let least = sigmas.get(components.saturating_sub(1)).copied().unwrap_or(0.0);
    let parts = blocks.iter().zip(&whole).map(|(block, pca)| {
        let kept = pca.basis.sigma().iter().filter(|sigma| **sigma >= least).count().max(1);
        Ok(block.basis_of_angles(&learn(block, kept)?)?)
    });
    let parts = parts.collect::<Result<Vec<Basis>, LearnError>>()?;
    // Blocks move different angles, so their modes are orthogonal as they are.
    let mean = parts.iter().map(Basis::mean).sum();
    let modes: Vec<_> =
        parts.iter().flat_map(|part| (0..part.rank()).map(|k| part.components().row(k) * part.sigma()[k])).collect();
    Ok(Basis::from_modes(mean, &DMatrix::from_rows(&modes))?)
}

/// Coefficients of every organ and of its mirror image.
fn both_ways(
    organs: &[&DVector<f64>],
    mirrored: impl Fn(&DVector<f64>) -> DVector<f64>,
    smooth: &Basis,
) -> Vec<Vec<f64>> {
    organs.iter().flat_map(|angles| [smooth.project(angles), smooth.project(&mirrored(angles))]).collect()
}

/// Mean coefficients, `None` of no organs.
fn mean(coefficients: &[Vec<f64>]) -> Option<Vec<f64>> {
    let first = coefficients.first()?;
    let sum = |k: usize| coefficients.iter().map(|c| c[k]).sum::<f64>();
    Some((0..first.len()).map(|k| sum(k) / coefficients.len() as f64).collect())
}
