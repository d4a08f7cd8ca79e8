//! Where a view's metres come from.

use demeter_frame::Semantic;
use glam::{DVec2, DVec3};

use super::View;
use crate::organs::ScaleSource;

/// Fewest ground pixels, as a share of the picture: 2 % is 130 x 47 pixels at 640 x 480 (a guess).
const MIN_GROUND: f64 = 0.02;
/// Largest spread (median absolute deviation) of the logarithm of the factor over the ground pixels: 0.15 is 15 % of a
/// length, more means that network and ground plane tell different scenes (a guess).
const MAX_SPREAD: f64 = 0.15;
/// Ground farther than this says little of a factor: the plane is seen too flat and fields are not that even, metres.
const MAX_GROUND_DEPTH: f64 = 10.0;
/// Plant depth when nothing tells it, metres: proportions hold, lengths mean nothing.
const NOMINAL_DEPTH: f64 = 1.0;

/// What turns exp(log depth) into depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthScale {
    /// Depth = factor * exp(log depth).
    pub factor: f64,
    /// Where the factor comes from.
    pub source: ScaleSource,
    /// Spread of the factor's logarithm where it was measured, else 0.
    pub spread: f64,
}

impl DepthScale {
    /// Depth along the camera's axis from its logarithm; `None` where that makes no depth.
    #[must_use]
    pub(super) fn depth(&self, log_depth: f64) -> Option<f64> {
        let z = log_depth.exp() * self.factor;
        // 1 km: beyond any plant, and far from where squares overflow.
        (z > 1e-6 && z < 1e3).then_some(z)
    }
}

/// Why there is no scale.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ScaleError {
    /// The view has no pose.
    #[error("scale from the ground: expected the camera's pose, found none")]
    NoPose,
    /// The ground does not show enough.
    #[error("scale from the ground: expected at least {expected} ground pixels, found {found}")]
    FewPixels {
        /// Pixels needed.
        expected: usize,
        /// Pixels there are.
        found: usize,
    },
    /// The ground's depths do not agree.
    #[error("scale from the ground: expected a spread of at most {expected}, found {found:.3}")]
    Spread {
        /// Largest spread accepted.
        expected: f64,
        /// The spread.
        found: f64,
    },
    /// No organ pixel has a depth.
    #[error("scale: expected depth on the plants, found none")]
    NoDepth,
}

/// The factor that lays the background on the ground plane z = 0: the median over its pixels.
///
/// # Errors
/// [`ScaleError`] when the ground does not tell.
pub fn ground_plane(view: &View<'_>) -> Result<DepthScale, ScaleError> {
    let pose = view.world_from_camera.ok_or(ScaleError::NoPose)?;
    let width = view.intrinsics.width as usize;
    let mut logs: Vec<f64> = Vec::new();
    for (p, &class) in view.semantic.as_raw().iter().enumerate() {
        let at = DVec2::new((p % width) as f64 + 0.5, (p / width) as f64 + 0.5);
        // The ray has z = 1 in the camera, so its parameter is depth.
        let ray = pose.rotation * view.intrinsics.unproject(at, 1.0);
        let depth = -pose.translation.z / ray.z;
        let seen = f64::from(view.log_depth.as_raw()[p]);
        if class == Semantic::Background as u8 && depth > 0.0 && depth < MAX_GROUND_DEPTH && seen.is_finite() {
            logs.push(depth.ln() - seen);
        }
    }
    let expected = (MIN_GROUND * view.semantic.as_raw().len() as f64).ceil() as usize;
    if logs.len() < expected.max(1) {
        return Err(ScaleError::FewPixels { expected, found: logs.len() });
    }
    let middle = median(&mut logs);
    let mut away: Vec<f64> = logs.iter().map(|l| (l - middle).abs()).collect();
    let spread = median(&mut away);
    if spread > MAX_SPREAD {
        return Err(ScaleError::Spread { expected: MAX_SPREAD, found: spread });
    }
    Ok(DepthScale { factor: middle.exp(), source: ScaleSource::GroundPlane, spread })
}

/// The factor that puts the organ pixels at 1 m (median): a scale that says `none`.
///
/// # Errors
/// [`ScaleError::NoDepth`] without an organ pixel with depth.
pub fn nominal(view: &View<'_>) -> Result<DepthScale, ScaleError> {
    let pixels = view.semantic.as_raw().iter().zip(view.log_depth.as_raw());
    let mut logs: Vec<f64> = pixels
        .filter(|&(&class, depth)| class != Semantic::Background as u8 && depth.is_finite())
        .map(|(_, &depth)| f64::from(depth))
        .collect();
    if logs.is_empty() {
        return Err(ScaleError::NoDepth);
    }
    Ok(DepthScale { factor: NOMINAL_DEPTH * (-median(&mut logs)).exp(), source: ScaleSource::None, spread: 0.0 })
}

/// The middle of at least one number, reordering them.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The direction that is up in the frame the view is lifted into: the world's z, or the picture's, for a camera held
/// level.
#[must_use]
pub(super) fn up(view: &View<'_>) -> DVec3 {
    if view.world_from_camera.is_some() { DVec3::Z } else { DVec3::NEG_Y }
}
