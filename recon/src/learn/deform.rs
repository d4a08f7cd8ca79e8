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
        let smooth = smooth(from)?;
        let leaves: Vec<&DVector<f64>> = lessons.iter().flat_map(|l| &l.leaves).collect();
        let stems: Vec<&DVector<f64>> = lessons.iter().flat_map(|l| &l.stems).collect();
        let hanging: Vec<Hanging> = lessons.iter().flat_map(|l| l.hanging.iter().copied()).collect();
        let leaf = leaf_basis(&leaves, &smooth, components.leaf)?;
        let stem =
            if stems.is_empty() { from.stem.deform.clone() } else { stem_basis(&stems, &smooth, components.stem)? };
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
pub(super) fn leaf_basis(leaves: &[&DVector<f64>], smooth: &Species, components: usize) -> Result<Basis, LearnError> {
    let coefficients = both_ways(leaves, mirrored_leaf, &smooth.leaf.deform);
    let mean = mean(&coefficients).ok_or(LearnError::NoBlades)?;
    let displacement = Displacement::of_leaf(smooth, mean).ok_or(LearnError::Still)?;
    components_of(&coefficients, &displacement, components)
}

/// The stems' basis of `components` modes.
pub(super) fn stem_basis(stems: &[&DVector<f64>], smooth: &Species, components: usize) -> Result<Basis, LearnError> {
    let coefficients = both_ways(stems, mirrored_stem, &smooth.stem.deform);
    let mean = mean(&coefficients).unwrap_or_default();
    let displacement = Displacement::of_stem(smooth, &mean).ok_or(LearnError::Still)?;
    components_of(&coefficients, &displacement, components)
}

/// Coefficients of every organ and of its mirror image.
pub(super) fn both_ways(
    organs: &[&DVector<f64>],
    mirrored: impl Fn(&DVector<f64>) -> DVector<f64>,
    smooth: &Basis,
) -> Vec<Vec<f64>> {
    organs.iter().flat_map(|angles| [smooth.project(angles), smooth.project(&mirrored(angles))]).collect()
}

/// Mean coefficients, `None` of no organs.
pub(super) fn mean(coefficients: &[Vec<f64>]) -> Option<Vec<f64>> {
    let first = coefficients.first()?;
    let sum = |k: usize| coefficients.iter().map(|c| c[k]).sum::<f64>();
    Some((0..first.len()).map(|k| sum(k) / coefficients.len() as f64).collect())
}

fn components_of(
    coefficients: &[Vec<f64>],
    displacement: &Displacement,
    components: usize,
) -> Result<Basis, LearnError> {
    let rows: Vec<_> = coefficients.iter().map(|c| displacement.of_coefficients(c).transpose()).collect();
    let samples = DMatrix::from_rows(&rows);
    let smooth = displacement.prior()?;
    let prior = Prior { basis: &smooth, mean_samples: 0.0, spread_samples: SMOOTH_SHARE * rows.len() as f64 };
    Ok(displacement.basis_of_angles(&Pca::adapted(prior, &samples, components)?)?)
}
