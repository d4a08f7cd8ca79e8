//! The soybeans of the authors' release as clouds whose organs are known.

use std::path::PathBuf;

use demeter_recon::cloud::{PointCloud, PointOrgan};
use demeter_recon::import::release::{RawForm, RawPlant};
use demeter_recon::metrics::{SURFACE_SAMPLES, sample_surface};
use demeter_recon::model::{Detail, Knots, OrganKind, PlantMesh};

use super::{files_of, folder};
use crate::commands::import::{bases, release_plant};
use crate::error::CommandError;

/// What tables call them.
pub(super) const NAME: &str = "soybean, the release's";

/// One of them.
pub(super) struct Released {
    /// Where it came from.
    pub folder: PathBuf,
    /// Its organs as they are written, parents among them.
    pub raw: RawPlant,
    /// Points on its surface with their organs, z up.
    pub cloud: PointCloud,
}

/// Every plant of a species' folder of the release.
///
/// # Errors
/// [`CommandError`] when the folder or a file of it is missing or broken.
pub(super) fn plants(release: &PathBuf) -> Result<Vec<Released>, CommandError> {
    let release = folder(Some(release), "", "--release")?;
    let bases = bases(&release)?;
    let mut found = Vec::new();
    for path in files_of(&release, "pkl")? {
        let folder = path.parent().unwrap_or(&release).to_path_buf();
        let raw = RawPlant::of(&release_plant(&folder)?, &bases);
        let posed = raw.pose().map_err(|error| CommandError::failed("release", &error).of(&folder))?;
        let mesh = PlantMesh::of(&posed, Detail::Control, Knots::Uniform);
        let organ = |number: u32| {
            let organ = &raw.organs[number as usize];
            let kind = match (&organ.form, organ.parent) {
                (RawForm::Leaf { .. }, _) => OrganKind::Leaf,
                (RawForm::Stem { .. }, None) => OrganKind::MainStem,
                (RawForm::Stem { .. }, Some(_)) => OrganKind::Stem,
            };
            PointOrgan { organ: number as i32, kind }
        };
        let samples = sample_surface(&mesh, SURFACE_SAMPLES, 1);
        let (points, organs) = samples.iter().map(|(p, face)| (*p, organ(mesh.organ_of_face[*face]))).unzip();
        found.push(Released {
            folder,
            raw,
            cloud: PointCloud { points, organs: Some(organs), ..PointCloud::default() },
        });
    }
    Ok(found)
}
