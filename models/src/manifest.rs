use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use demeter_frame::Semantic;
use serde::{Deserialize, Serialize};

use crate::{Layout, ModelError};

/// One input or output.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Port {
    /// Its name in the graph.
    pub name: String,
    /// Its shape; -1 for a dimension that the caller chooses.
    pub shape: Vec<i64>,
    /// Its element type as ONNX Runtime spells it here: `f32`, `i64`.
    pub dtype: String,
}

impl std::fmt::Display for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}{:?}", self.name, self.dtype, self.shape)
    }
}

/// One data set that a model learned from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataSet {
    /// Images, clouds or other samples in it.
    #[serde(alias = "images")]
    pub samples: u64,
    /// Seed it was made with.
    pub seed: u64,
    /// Program that made it, with its version.
    pub program: String,
    /// Over its files, in the order of their names.
    pub sha256: String,
}

/// How a model came to be, so that anyone can make it again and judge it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The command that trained it.
    pub command: String,
    /// The seed of weights, order and augmentation.
    pub seed: u64,
    /// Optimiser steps, all runs together.
    pub steps: u64,
    /// What trained it, with versions.
    pub program: String,
    /// What it was trained on.
    pub data: Vec<DataSet>,
    /// Measured on held-out images, by name.
    pub figures: BTreeMap<String, f64>,
}

/// What is known of the model file beside it: `NAME.toml` describes `NAME.onnx`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The model's name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// What its inputs and outputs mean.
    pub layout: Layout,
    /// Of the model file, lower-case hexadecimal.
    pub sha256: String,
    /// What the caller must do to the input's numbers; for people.
    pub normalisation: String,
    /// Where a model of other people comes from and on what terms; for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// The organ that each of a detector's classes is, by the class's number; what is `background` or beyond the end is
    /// no organ.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub classes: Vec<Semantic>,
    /// Inputs in the graph's order.
    pub inputs: Vec<Port>,
    /// Outputs in the graph's order.
    pub outputs: Vec<Port>,
    /// How one of ours came to be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

impl Manifest {
    /// Reads a manifest.
    ///
    /// # Errors
    /// [`ModelError::Io`] and [`ModelError::Manifest`], which names the key.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let text = std::fs::read_to_string(path).map_err(|source| ModelError::Io { path: path.into(), source })?;
        toml::from_str(&text).map_err(|source| ModelError::Manifest { path: path.into(), source: Box::new(source) })
    }

    /// The model file that the manifest at `path` describes.
    #[must_use]
    pub fn model_path(path: &Path) -> PathBuf {
        path.with_extension("onnx")
    }
}
