//! How well a species explains blades that it was not learned from.

use glam::DVec3;

use super::lesson::MIN_POINTS;
use crate::fit::{FitError, lone_blade};
use crate::metrics::chamfer;
use crate::model::{Detail, Knots, OrganKind, PlantMesh, Species};
use crate::organs::OrganCloud;

/// Chamfer distance of each blade among `organs`, fitted by itself, to its points, divided by the diagonal of those
/// points; blades of too few points to tell are left out.
///
/// # Errors
/// [`FitError`] when a blade cannot be fitted.
pub fn blade_errors(organs: &[OrganCloud], up: DVec3, species: &Species) -> Result<Vec<f64>, FitError> {
    let blades = organs.iter().filter(|o| o.kind == OrganKind::Leaf && o.points.len() >= MIN_POINTS);
    let error = |blade: &OrganCloud| {
        let posed = lone_blade(&blade.points, None, up, species)?.posed(species);
        Ok(chamfer(&blade.points, &PlantMesh::of(&posed, Detail::Control, Knots::Uniform)).map(|found| found.cd))
    };
    blades.filter_map(|blade| error(blade).transpose()).collect()
}
