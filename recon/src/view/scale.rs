//! Where a view's metres come from.

use demeter_frame::Semantic;
use glam::{DVec2, DVec3};

use super::View;
use crate::organs::ScaleSource;
use crate::statistics::median;

/// Fewest ground pixels, as a share of the picture: 2 % is 130 x 47 pixels at 640 x 480 (a guess).
const MIN_GROUND: f64 = 0.02;
/// Largest spread of the logarithm of depth about the ground's: 0.15 is 15 % of a length, more means that network and
/// ground plane tell different scenes (a guess).
const MAX_SPREAD: f64 = 0.15;
/// Exponents that a network may need; beyond them its depths and the ground's have little to do with each other (guesses).
const EXPONENTS: (f64, f64) = (0.5, 3.0);
/// Rounds of the line's fit; each gives pixels far off the last line less weight.
const ROUNDS: usize = 8;
/// Ground farther than this says little of a factor: the plane is seen too flat and fields are not that even, metres.
const MAX_GROUND_DEPTH: f64 = 10.0;
/// Plant depth when nothing tells it, metres: proportions hold, lengths mean nothing.
const NOMINAL_DEPTH: f64 = 1.0;

/// What turns exp(log depth) into depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthScale {
    /// Depth = factor * exp(exponent * log depth).
    pub factor: f64,
    /// What stretches the network's range of depths, which is often too narrow; 1 where nothing tells it.
    pub exponent: f64,
    /// Where the factor comes from.
    pub source: ScaleSource,
    /// Spread (median absolute deviation) of the logarithm of depth about the ground's where it was measured, else 0.
    pub spread: f64,
}

impl DepthScale {
    /// Of logarithms of metres.
    pub const METRIC: Self = Self { factor: 1.0, exponent: 1.0, source: ScaleSource::MetricModel, spread: 0.0 };

    /// Depth along the camera's axis from its logarithm; `None` where that makes no depth.
    #[must_use]
    pub(super) fn depth(&self, log_depth: f64) -> Option<f64> {
        let z = (self.exponent * log_depth).exp() * self.factor;
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

/// The factor and exponent that lay the background on the ground plane z = 0: the line of the plane's log depth over
/// the network's, by iteratively reweighted least squares.
///
/// # Errors
/// [`ScaleError`] when the ground does not tell.
pub fn ground_plane(view: &View<'_>) -> Result<DepthScale, ScaleError> {
    let pose = view.world_from_camera.ok_or(ScaleError::NoPose)?;
    let width = view.intrinsics.width as usize;
    // The network's log depth and the plane's, of each ground pixel.
    let mut logs: Vec<(f64, f64)> = Vec::new();
    for (p, &class) in view.semantic.as_raw().iter().enumerate() {
        let at = DVec2::new((p % width) as f64 + 0.5, (p / width) as f64 + 0.5);
        // The ray has z = 1 in the camera, so its parameter is depth.
        let ray = pose.rotation * view.intrinsics.unproject(at, 1.0);
        let depth = -pose.translation.z / ray.z;
        let seen = f64::from(view.log_depth.as_raw()[p]);
        if class == Semantic::Background as u8 && depth > 0.0 && depth < MAX_GROUND_DEPTH && seen.is_finite() {
            logs.push((seen, depth.ln()));
        }
    }
    let expected = (MIN_GROUND * view.semantic.as_raw().len() as f64).ceil() as usize;
    if logs.len() < expected.max(1) {
        return Err(ScaleError::FewPixels { expected, found: logs.len() });
    }
    let (exponent, offset) = line(&logs);
    let away = logs.iter().map(|(x, y)| (exponent * x + offset - y).abs());
    let spread = median(away).unwrap_or(f64::INFINITY);
    if !(spread <= MAX_SPREAD && offset.exp().is_normal()) {
        return Err(ScaleError::Spread { expected: MAX_SPREAD, found: spread });
    }
    Ok(DepthScale { factor: offset.exp(), exponent, source: ScaleSource::GroundPlane, spread })
}

/// Slope and offset of the line through points that most of them agree on; the slope stays in [`EXPONENTS`], and is 1
/// where the points do not differ enough to tell.
fn line(points: &[(f64, f64)]) -> (f64, f64) {
    // Differences of log depth below this tell noise: 2 % of a depth.
    const TELLING: f64 = 0.02;
    let (mut slope, mut offset) = (1.0, 0.0);
    for round in 0..ROUNDS {
        let weight = |x: f64, y: f64| if round == 0 { 1.0 } else { 1.0 / (slope * x + offset - y).abs().max(TELLING) };
        let (mut total, mut mx, mut my) = (0.0, 0.0, 0.0);
        for &(x, y) in points {
            let w = weight(x, y);
            (total, mx, my) = (total + w, mx + w * x, my + w * y);
        }
        (mx, my) = (mx / total, my / total);
        let (mut xx, mut xy) = (0.0, 0.0);
        for &(x, y) in points {
            let w = weight(x, y) / total;
            (xx, xy) = (xx + w * (x - mx) * (x - mx), xy + w * (x - mx) * (y - my));
        }
        slope = if xx > TELLING * TELLING { (xy / xx).clamp(EXPONENTS.0, EXPONENTS.1) } else { 1.0 };
        offset = my - slope * mx;
    }
    (slope, offset)
}

/// The factor that puts the organ pixels at 1 m (median): a scale that says `none`.
///
/// # Errors
/// [`ScaleError::NoDepth`] without an organ pixel with depth.
pub fn nominal(view: &View<'_>) -> Result<DepthScale, ScaleError> {
    let pixels = view.semantic.as_raw().iter().zip(view.log_depth.as_raw());
    let logs = pixels
        .filter(|&(&class, depth)| class != Semantic::Background as u8 && depth.is_finite())
        .map(|(_, &depth)| f64::from(depth));
    let factor = NOMINAL_DEPTH * (-median(logs).ok_or(ScaleError::NoDepth)?).exp();
    Ok(DepthScale { factor, exponent: 1.0, source: ScaleSource::None, spread: 0.0 })
}

/// The direction that is up in the frame the view is lifted into: the world's z, or the picture's, for a camera held
/// level.
#[must_use]
pub(super) fn up(view: &View<'_>) -> DVec3 {
    if view.world_from_camera.is_some() { DVec3::Z } else { DVec3::NEG_Y }
}
