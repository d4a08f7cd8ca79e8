use glam::DVec3;

use crate::cloud::diagonal;
use crate::model::PlantError;

/// Fewest points of an organ.
pub(crate) const MIN_POINTS: usize = 3;
/// Least extent of an organ, metres.
pub(crate) const MIN_EXTENT: f64 = 1e-4;

/// Why an organ, or a whole tree, cannot be fitted.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum FitError {
    /// Too few points to say anything.
    #[error("organ {organ}: expected at least {expected} points, found {found}")]
    Points {
        /// Index in the tree.
        organ: usize,
        /// The least number.
        expected: usize,
        /// Its points.
        found: usize,
    },
    /// A cloud with no extent or with numbers that are not finite.
    #[error("organ {organ}: expected finite points that span more than {expected_metres} m, found {found_metres} m")]
    Extent {
        /// Index in the tree.
        organ: usize,
        /// Least extent.
        expected_metres: f64,
        /// Its extent.
        found_metres: f64,
    },
    /// The tree is none.
    #[error("organ tree: {0}")]
    Plant(#[from] PlantError),
}

/// Whether there is something to fit an organ to.
pub(super) fn check(organ: usize, points: &[DVec3]) -> Result<(), FitError> {
    if points.len() < MIN_POINTS {
        return Err(FitError::Points { organ, expected: MIN_POINTS, found: points.len() });
    }
    let finite = points.iter().all(|p| p.is_finite());
    let found_metres = if finite { diagonal(points).unwrap_or(0.0) } else { f64::NAN };
    if !(found_metres.is_finite() && found_metres > MIN_EXTENT) {
        return Err(FitError::Extent { organ, expected_metres: MIN_EXTENT, found_metres });
    }
    Ok(())
}
