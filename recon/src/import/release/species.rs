//! The release's bases as a species of ours, as near as ours can hold them.
//!
//! Theirs are bases of control-point positions, ours of joint angles, so leaves and stems are drawn from theirs as
//! normally as their σ say, turned into angles exactly, and analysed again into as many components. Their flat leaf is
//! about 0.93 long and its tip moves by a thousandth with β; ours is drawn likewise, brought to unit length and
//! analysed again.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::bases::{Bases, Linear};
use super::raw::{RawForm, unit};
use crate::learn::{Pca, PcaError};
use crate::model::leaf::LeafModel;
use crate::model::species::SpeciesError;
use crate::model::stem::StemModel;
use crate::model::{Habit, Ranges, Species};
use crate::world::normal;

/// What every species made from the release says of itself.
pub const PROVENANCE: &str = "imported from the authors' Demeter release: academic, non-commercial licence, never to be \
                              shipped; angles analysed anew from its position bases";
/// Organs drawn from each basis: enough that σ of the last component is known to a tenth (1/sqrt(2 x 256) = 4 %).
const DRAWN: usize = 256;

/// Why bases make no species.
#[derive(Debug, thiserror::Error)]
pub enum SpeciesImportError {
    /// Organs drawn from a basis that have no variance or are not finite.
    #[error("release bases: {0}")]
    Pca(#[from] PcaError),
    /// The result is no species.
    #[error(transparent)]
    Species(#[from] SpeciesError),
}

impl Bases {
    /// A species named `name` with these bases; `habit` and `ranges` are not in the release.
    ///
    /// # Errors
    /// [`SpeciesImportError`] when the bases have no variance.
    pub fn species(&self, name: &str, habit: Habit, ranges: Ranges) -> Result<Species, SpeciesImportError> {
        let shape = redrawn(&self.shape, |c| {
            let beta: Vec<f64> = c.iter().zip(&self.shape.sigma).map(|(c, sigma)| c / sigma).collect();
            unit(&self.flat(&beta)).0.iter().flat_map(|p| [p.x, p.y]).collect()
        })?;
        let mean = self.flat(&[]);
        let bend = redrawn(&self.leaf, |c| angles(&RawForm::leaf(&mean, &self.leaf(&mean, c), 1.0).0))?;
        let bow = redrawn(&self.stem, |c| angles(&RawForm::stem(&self.stem(c), 0.0).0))?;
        let leaf = LeafModel { shape: shape.basis, deform: bend.basis };
        Ok(Species::new(name, habit, ranges, PROVENANCE, &leaf, &StemModel { deform: bow.basis })?)
    }
}

fn angles(form: &RawForm) -> Vec<f64> {
    let (RawForm::Stem { angles, .. } | RawForm::Leaf { angles, .. }) = form;
    angles.as_slice().to_vec()
}

/// Principal components of what `output` makes of coefficients drawn from a basis.
fn redrawn(basis: &Linear, output: impl Fn(&[f64]) -> Vec<f64>) -> Result<Pca, PcaError> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let rows: Vec<f64> = (0..DRAWN)
        .flat_map(|_| {
            let drawn: Vec<f64> = basis.sigma.iter().map(|sigma| sigma * normal(&mut random)).collect();
            output(&drawn)
        })
        .collect();
    Pca::new(&DMatrix::from_row_slice(DRAWN, rows.len() / DRAWN, &rows), basis.sigma.len())
}
