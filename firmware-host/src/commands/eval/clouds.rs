//! Clouds of several species and what is made of one.

use std::path::{Path, PathBuf};

use demeter_recon::cloud::PointCloud;
use demeter_recon::model::Species;
use demeter_recon::organs::{OrganTree, ScaleSource};
use demeter_recon::segment::{Labels, Up};
use demeter_recon::{fit, species, tree};

use crate::describe::{Described, Encoding, describe};
use crate::divider::Divider;
use crate::error::CommandError;
use crate::files;

/// Reads a cloud whose unit is `metres` long.
pub(super) fn read(path: &Path, metres: f64) -> Result<PointCloud, CommandError> {
    let mut cloud =
        PointCloud::from_ply(&files::read(path)?).map_err(|error| CommandError::failed("ply", &error).of(path))?;
    cloud.points.iter_mut().for_each(|p| *p *= metres);
    Ok(cloud)
}

/// The shipped species whose name begins the file's name, else its folder's.
pub(super) fn species_of(path: &Path) -> Option<&'static str> {
    let names = [path.file_stem(), path.parent().and_then(Path::file_name)];
    names.into_iter().flatten().find_map(|name| {
        let name = name.to_string_lossy();
        species::NAMES.into_iter().find(|species| name.starts_with(species))
    })
}

/// A cloud, the organs it was divided into and the plant that its record holds.
pub(super) struct Fitted {
    /// The organs with their points.
    pub tree: OrganTree,
    /// For each organ of the plant the tree's organ it was fitted to.
    pub source: Vec<Option<usize>>,
    /// The decoded plant and what is told of it.
    pub described: Described,
}

/// The whole way from points to the decoded record.
///
/// # Errors
/// The reason in words, for the table's notes: a plant that cannot be fitted does not stop the others.
pub(super) fn whole(
    cloud: &PointCloud,
    species: &Species,
    divider: &mut Divider,
    labels: Labels,
    up: Up,
) -> Result<Fitted, CommandError> {
    let failed = |kind: &'static str, error: &dyn std::error::Error| CommandError::failed(kind, error);
    let divided = divider.divide(cloud, species, labels, up).map_err(|error| failed("segmentation", &error))?;
    let segmented = divided.segmented;
    let tree = tree::build(segmented.organs).map_err(|error| failed("topology", &error))?;
    let fitted = fit::plant(&tree, species, segmented.up).map_err(|error| failed("fit", &error))?;
    let source = fitted.organs.iter().map(|organ| organ.source).collect();
    let described = describe(&fitted, species, &cloud.points, ScaleSource::Input, Encoding::Compact)?;
    Ok(Fitted { tree, source, described })
}

/// Every `every`-th of some files.
pub(super) fn some(files: Vec<PathBuf>, every: usize) -> Vec<PathBuf> {
    files.into_iter().step_by(every.max(1)).collect()
}
