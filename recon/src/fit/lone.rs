//! A blade by itself: a scan of one leaf, or one leaf's points of a plant's.

use glam::DVec3;

use super::{FitError, OrganFit, error, leaf};
use crate::model::Species;
use crate::model::kinematics::{PosedPlant, Similarity};
use crate::model::leaf::Blade;

/// A blade fitted by itself; its main vein may start at either end of its points.
#[derive(Clone, Debug, PartialEq)]
pub struct LoneBlade {
    /// world_from_organ: base, rotation and flat chord (metres).
    pub world_from_blade: Similarity,
    /// Its parameters.
    pub blade: Blade,
    /// How well it fits.
    pub fit: OrganFit,
}

impl LoneBlade {
    /// The blade in the world, in the form that meshes are made of.
    #[must_use]
    pub fn posed(&self, species: &Species) -> PosedPlant {
        let grid = species.leaf.grid(&self.blade);
        PosedPlant {
            world_from_organ: vec![self.world_from_blade],
            control: vec![grid.points.iter().map(|p| self.world_from_blade.point(*p)).collect()],
            radius: vec![0.0],
            side: vec![self.world_from_blade.rotation * DVec3::X],
        }
    }
}

/// Fits the points of one blade, petiole left out. Its main vein starts at `base`, or where that is not known at either
/// end of the points; `up` tells its upper side where the points cannot.
///
/// # Errors
/// [`FitError`] when there are too few points, or without extent.
pub fn lone_blade(points: &[DVec3], base: Option<DVec3>, up: DVec3, species: &Species) -> Result<LoneBlade, FitError> {
    error::check(0, points)?;
    let fit = match base {
        Some(base) => leaf::fit(points, base, up, species),
        None => leaf::alone(points, up, species),
    };
    Ok(LoneBlade {
        world_from_blade: Similarity { rotation: fit.rotation, translation: fit.base, scale: fit.length },
        blade: fit.blade,
        fit: OrganFit {
            source: Some(0),
            points: points.len(),
            residual: Some(fit.residual),
            visible_fraction: Some(fit.visible),
            converged: fit.converged,
            sigmas: fit.sigmas,
        },
    })
}
