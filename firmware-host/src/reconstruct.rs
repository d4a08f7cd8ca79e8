//! A view's organs to a fitted plant.

use demeter_recon::fit::{self, FitError, Fitted};
use demeter_recon::model::{PlantError, Species};
use demeter_recon::organs::{OrganCloud, OrganTree};
use demeter_recon::tree::{self, TreeError};
use glam::DVec3;

use crate::error::CommandError;

/// Why organs gave no plant.
#[derive(Debug, thiserror::Error)]
pub enum ReconstructError {
    /// They form no tree.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// They cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The plant cannot be recorded or reported.
    #[error(transparent)]
    Record(#[from] CommandError),
    /// The recorded plant is none.
    #[error(transparent)]
    Plant(#[from] PlantError),
}

impl ReconstructError {
    /// A stable word for counters, events and --json.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Tree(_) => "topology",
            Self::Fit(_) => "fit",
            Self::Record(_) | Self::Plant(_) => "record",
        }
    }
}

/// Joins a view's organs to a tree, without the stems that carry nothing.
///
/// # Errors
/// [`TreeError`] when they form none.
pub fn organ_tree(organs: Vec<OrganCloud>) -> Result<OrganTree, TreeError> {
    Ok(tree::without_bare_stems(tree::build(organs)?))
}

/// Fits the tree of a view's organs; gives the tree too. `up` is the vertical of their frame.
///
/// # Errors
/// [`ReconstructError`] when they form no tree or cannot be fitted.
pub fn fit_organs(
    organs: Vec<OrganCloud>,
    species: &Species,
    up: DVec3,
) -> Result<(Fitted, OrganTree), ReconstructError> {
    let tree = organ_tree(organs)?;
    let fitted = fit::plant(&tree, species, up)?;
    Ok((fitted, tree))
}
