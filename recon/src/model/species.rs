//! Everything a species knows, in one file: template, bases, ranges, priors, provenance.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use serde::{Deserialize, Serialize};

use super::basis::{Basis, BasisError};
use super::leaf::{self, LeafModel};
use super::priors::Priors;
use super::stem::{self, StemModel};

/// A plausible range, in the unit of its field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Smallest plausible value.
    pub min: f64,
    /// Largest plausible value.
    pub max: f64,
}

impl Range {
    /// A range from its ends.
    #[must_use]
    pub const fn new(min: f64, max: f64) -> Self {
        Self { min, max }
    }

    /// The value at `t` in 0..=1.
    #[must_use]
    pub fn lerp(&self, t: f64) -> f64 {
        self.min + (self.max - self.min) * t
    }

    /// The nearest value inside.
    #[must_use]
    pub fn clamp(&self, x: f64) -> f64 {
        x.clamp(self.min, self.max)
    }
}

/// Plausible ranges of sizes, metres unless said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ranges {
    /// Chord of a flat blade, base to tip.
    pub blade_length: Range,
    /// Path length of any stem.
    pub stem_length: Range,
    /// Radius of any stem.
    pub stem_radius: Range,
    /// Cross-vein scaling s_x, without unit.
    pub blade_width: Range,
}

/// How a species carries its leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Habit {
    /// Strap leaves that leave the main stem without a petiole; s_x is fitted.
    Grass,
    /// Leaves on petioles, one blade each.
    Simple,
    /// Leaves on petioles, several leaflets each.
    Compound,
}

/// Most leaflets of one leaf (soybean and bean 3, tomato up to 9).
const MAX_LEAFLETS: usize = 9;
/// Longest petiolule as a share of its leaflet (a guess: soybean's, bean's and tomato's are shorter, and the petioles
/// of neighbouring leaves are not).
const PETIOLULE_SHARE: f64 = 0.5;

impl Habit {
    /// Whether so many blades on one petiole may be one leaf's.
    pub(crate) fn shares_a_petiole(self, blades: usize) -> bool {
        self == Self::Compound && blades <= MAX_LEAFLETS
    }

    /// Whether a stalk may be a petiolule of a blade; lengths in one unit.
    pub(crate) fn is_petiolule(self, stalk: f64, blade: f64) -> bool {
        self == Self::Compound && stalk < PETIOLULE_SHARE * blade
    }
}

/// A species of the Demeter model.
#[derive(Clone, Debug, PartialEq)]
pub struct Species {
    /// `soybean`, `maize`, ...
    pub name: String,
    /// How it carries its leaves.
    pub habit: Habit,
    /// Plausible sizes.
    pub ranges: Ranges,
    /// How its organs usually hang.
    pub priors: Priors,
    /// Where the bases come from: data, licence, command.
    pub provenance: String,
    /// Its leaves.
    pub leaf: LeafModel,
    /// Its stems.
    pub stem: StemModel,
    hash: String,
}

/// Why bytes are no species file.
#[derive(Debug, thiserror::Error)]
pub enum SpeciesError {
    /// A packed file that does not unpack.
    #[error("species file: expected gzip, found {0}")]
    Packed(#[from] std::io::Error),
    /// Not safetensors, or broken.
    #[error("species file: expected safetensors, found {0}")]
    Container(#[from] safetensors::SafeTensorError),
    /// The JSON header lacks a key or has it wrong.
    #[error("species file header `{key}`: expected {expected}, found {found}")]
    Header {
        /// The key.
        key: &'static str,
        /// What it must hold.
        expected: &'static str,
        /// What was found.
        found: String,
    },
    /// A tensor with the wrong type or size.
    #[error("species file tensor `{tensor}`: expected f32 of {expected} numbers, found {found}")]
    Tensor {
        /// The tensor.
        tensor: String,
        /// Numbers it must hold.
        expected: usize,
        /// What was found.
        found: String,
    },
    /// A basis that is none.
    #[error("species file: {0}")]
    Basis(#[from] BasisError),
}

/// The JSON header besides the tensors.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: String,
    name: String,
    habit: Habit,
    ranges: Ranges,
    priors: Priors,
    provenance: String,
}

/// Name and version of the file's layout.
const FORMAT: &str = "demeter-species 2";

impl Species {
    /// A species from its parts, with priors that say nothing.
    ///
    /// # Errors
    /// [`SpeciesError`] when sizes or bases are wrong.
    pub fn new(
        name: &str,
        habit: Habit,
        ranges: Ranges,
        provenance: &str,
        leaf: &LeafModel,
        stem: &StemModel,
    ) -> Result<Self, SpeciesError> {
        let (name, provenance, leaf, stem) = (name.into(), provenance.into(), leaf.clone(), stem.clone());
        let priors = Priors::UNKNOWN;
        Self { name, habit, ranges, priors, provenance, leaf, stem, hash: String::new() }.sealed()
    }

    /// The species checked and hashed anew after a part was changed. Numbers are rounded to f32 as the file keeps
    /// them, so that a species in memory and the same one read back are equal.
    ///
    /// # Errors
    /// [`SpeciesError`] naming what is wrong.
    pub fn sealed(self) -> Result<Self, SpeciesError> {
        Self::from_bytes(&self.to_bytes()?)
    }

    /// Reads a species file: safetensors with tensors `leaf.shape.{mean,components,sigma}`,
    /// `leaf.deform.*`, `stem.deform.*` (f32) and the metadata entry `species` (JSON).
    ///
    /// # Errors
    /// [`SpeciesError`] naming the tensor or key.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SpeciesError> {
        let (_, metadata) = SafeTensors::read_metadata(bytes)?;
        let metadata = metadata.metadata().clone().unwrap_or_default();
        let bad = |key, expected, found: String| SpeciesError::Header { key, expected, found };
        let header: Header = serde_json::from_str(metadata.get("species").map_or("", String::as_str))
            .map_err(|error| bad("species", "the species' JSON", error.to_string()))?;
        if header.format != FORMAT {
            return Err(bad("format", FORMAT, header.format));
        }
        if !header.priors.is_valid() {
            return Err(bad("priors", "finite means and standard deviations above 0", format!("{:?}", header.priors)));
        }
        let tensors = SafeTensors::deserialize(bytes)?;
        let leaf = LeafModel {
            shape: read_basis(&tensors, "leaf.shape", leaf::POINTS * 2)?,
            deform: read_basis(&tensors, "leaf.deform", leaf::ANGLES)?,
        };
        let stem = StemModel { deform: read_basis(&tensors, "stem.deform", stem::ANGLES)? };
        Ok(Self {
            name: header.name,
            habit: header.habit,
            ranges: header.ranges,
            priors: header.priors,
            provenance: header.provenance,
            leaf,
            stem,
            hash: blake3::hash(bytes).to_hex().to_string(),
        })
    }

    /// The species file.
    ///
    /// # Errors
    /// [`SpeciesError::Container`] when it cannot be serialised.
    pub fn to_bytes(&self) -> Result<Vec<u8>, SpeciesError> {
        let header = Header {
            format: FORMAT.into(),
            name: self.name.clone(),
            habit: self.habit,
            ranges: self.ranges,
            priors: self.priors,
            provenance: self.provenance.clone(),
        };
        to_bytes(&header, &self.leaf, &self.stem)
    }

    /// BLAKE3 of the file, hexadecimal: what records name.
    #[must_use]
    pub fn hash(&self) -> &str {
        &self.hash
    }
}

fn to_bytes(header: &Header, leaf: &LeafModel, stem: &StemModel) -> Result<Vec<u8>, SpeciesError> {
    let f32s = |xs: &[f64]| -> Vec<u8> { xs.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect() };
    let mut blobs = Vec::new();
    for (name, basis) in [("leaf.shape", &leaf.shape), ("leaf.deform", &leaf.deform), ("stem.deform", &stem.deform)] {
        let (k, n) = (basis.rank(), basis.dim());
        blobs.push((format!("{name}.mean"), vec![n], f32s(basis.mean().as_slice())));
        // Row-major on disk: component by component, as any reader of the file expects.
        blobs.push((format!("{name}.components"), vec![k, n], f32s(basis.components().transpose().as_slice())));
        blobs.push((format!("{name}.sigma"), vec![k], f32s(basis.sigma().as_slice())));
    }
    let views: BTreeMap<String, TensorView<'_>> = blobs
        .iter()
        .map(|(name, shape, data)| Ok((name.clone(), TensorView::new(Dtype::F32, shape.clone(), data)?)))
        .collect::<Result<_, safetensors::SafeTensorError>>()?;
    let json = serde_json::to_string(header).map_err(|error| SpeciesError::Header {
        key: "species",
        expected: "serialisable numbers",
        found: error.to_string(),
    })?;
    // One entry only: the crate keeps metadata in a hash map, whose order would change the file's hash.
    Ok(safetensors::serialize(views, Some([("species".to_owned(), json)].into()))?)
}

fn read_basis(tensors: &SafeTensors<'_>, name: &str, n: usize) -> Result<Basis, SpeciesError> {
    let read = |part: &str, expected: Option<usize>| -> Result<Vec<f64>, SpeciesError> {
        let tensor = format!("{name}.{part}");
        let view = tensors.tensor(&tensor)?;
        let found = view.data().len() / 4;
        let expected = expected.unwrap_or(found);
        if view.dtype() != Dtype::F32 || found != expected {
            return Err(SpeciesError::Tensor { tensor, expected, found: format!("{:?} of {found}", view.dtype()) });
        }
        let number = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        Ok(view.data().chunks_exact(4).map(number).collect())
    };
    let sigma = read("sigma", None)?;
    let k = sigma.len();
    let components = DMatrix::from_row_slice(k, n, &read("components", Some(k * n))?);
    Ok(Basis::new(DVector::from_vec(read("mean", Some(n))?), components, DVector::from_vec(sigma))?)
}
