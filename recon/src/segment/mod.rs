//! Clouds to organs (spec/reconstruction.md "Points to organs"): by labels where there are any, else by geometry and by
//! what a network says of the points.

mod apart;
mod beside;
mod blades;
mod broadleaf;
mod foot;
mod grass;
mod labelled;
mod lattice;
mod parting;
mod stems;
mod unlabelled;
mod up;

use demeter_frame::PointMaps;
use glam::DVec3;

use crate::cloud::{PointCloud, PointOrgan, diagonal};
use crate::fit;
use crate::model::{OrganKind, Species};
use crate::nearest::Nearest;
use crate::organs::OrganCloud;
use crate::statistics::median;
pub use up::Up;

/// Where organ labels come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Labels {
    /// The cloud's organs when they are apart already, else its labels, else geometry.
    #[default]
    Auto,
    /// The cloud's labels; it must have them.
    Own,
    /// Geometry, whatever the cloud says.
    None,
}

/// Why a cloud cannot be divided.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum SegmentError {
    /// Too few points for any plant.
    #[error("cloud: expected at least {expected} points, found {found}")]
    Points {
        /// The least number.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// Points that all coincide, or are not finite.
    #[error("cloud: expected finite points with an extent, found a bounding box diagonal of {found_metres} m")]
    Extent {
        /// The diagonal.
        found_metres: f64,
    },
    /// Labels were asked for and are not there.
    #[error("cloud: expected a `label` property with 0 for stems and 1.. for leaves, found {found}")]
    Labels {
        /// What is there.
        found: &'static str,
    },
    /// What a network says is of another cloud.
    #[error("network: expected an answer for each of {expected} points, found {found}")]
    Maps {
        /// Points.
        expected: usize,
        /// Answers.
        found: usize,
    },
    /// Organs are apart, and the points of one disagree about what it is.
    #[error("organ {organ}: expected one `kind` for all its points, found several")]
    Kinds {
        /// Its number.
        organ: i32,
    },
}

/// Fewest points of a cloud that may be a plant.
const MIN_POINTS: usize = 50;
/// Fewest points of an organ; smaller clusters go to their neighbour.
const MIN_ORGAN_POINTS: usize = 12;

/// A cloud divided into organs, with the vertical that was found or given.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmented {
    /// Exactly one main stem, then stems and leaves.
    pub organs: Vec<OrganCloud>,
    /// Unit vertical in the cloud's frame.
    pub up: DVec3,
}

impl Segmented {
    /// The organ of each of the cloud's `count` points, by its index; negative for those that no organ has.
    #[must_use]
    pub fn of_points(&self, count: usize) -> Vec<PointOrgan> {
        let mut of = vec![PointOrgan { organ: -1, kind: OrganKind::Stem }; count];
        for (k, organ) in (0..).zip(&self.organs) {
            organ.source.iter().for_each(|i| of[*i as usize] = PointOrgan { organ: k, kind: organ.kind });
        }
        of
    }
}

/// Divides a cloud into organs.
///
/// # Errors
/// [`SegmentError`] when the cloud is too small, not finite, or lacks labels that were asked for,
/// or when a given organ is of several kinds.
pub fn segment(cloud: &PointCloud, species: &Species, labels: Labels, up: Up) -> Result<Segmented, SegmentError> {
    check(&cloud.points)?;
    match (labels, &cloud.organs, &cloud.labels) {
        (Labels::Auto, Some(organs), _) => apart::segment(&cloud.points, organs, up),
        (Labels::Auto | Labels::Own, _, Some(own)) => Ok(labelled::segment(&cloud.points, own, species.habit, up)),
        (Labels::Own, _, None) => Err(SegmentError::Labels { found: "none" }),
        (Labels::None, _, _) | (Labels::Auto, None, None) => Ok(unlabelled::segment(&cloud.points, None, species, up)),
    }
}

/// Divides a cloud into organs by geometry and by what a network says of its points.
///
/// # Errors
/// [`SegmentError`] when the cloud is too small or not finite, or `maps` is of another number of points.
pub fn segment_predicted(
    points: &[DVec3],
    maps: &PointMaps,
    species: &Species,
    up: Up,
) -> Result<Segmented, SegmentError> {
    check(points)?;
    let expected = points.len();
    if let Some(found) = [maps.probabilities.len(), maps.boundary.len()].into_iter().find(|n| *n != expected) {
        return Err(SegmentError::Maps { expected, found });
    }
    Ok(unlabelled::segment(points, Some(maps), species, up))
}

/// Refuses clouds that are no plant's.
fn check(points: &[DVec3]) -> Result<(), SegmentError> {
    let found = points.len();
    if found < MIN_POINTS {
        return Err(SegmentError::Points { expected: MIN_POINTS, found });
    }
    let finite = points.iter().all(|p| p.is_finite());
    let found_metres = if finite { diagonal(points).unwrap_or(0.0) } else { f64::NAN };
    if !(found_metres.is_finite() && found_metres > 1e-3) {
        return Err(SegmentError::Extent { found_metres });
    }
    Ok(())
}

/// Geometry leaves scraps: a branch of a point or two, or of points that coincide. The main stem stays, whatever it is.
fn is_fittable(organ: &OrganCloud) -> bool {
    organ.kind == OrganKind::MainStem
        || (organ.points.len() >= fit::MIN_POINTS && diagonal(&organ.points).is_some_and(|d| d > fit::MIN_EXTENT))
}

/// The points with these indices as an organ.
fn organ(points: &[DVec3], kind: OrganKind, mut members: Vec<usize>) -> OrganCloud {
    members.sort_unstable();
    OrganCloud {
        kind,
        points: members.iter().map(|i| points[*i]).collect(),
        source: members.into_iter().map(|i| i as u32).collect(),
    }
}

/// Distance to the `k`-th neighbour, its median over a sample, metres: the cloud's grain.
fn grain(points: &[DVec3], search: &Nearest, k: usize) -> f64 {
    let stride = points.len().div_ceil(2_000).max(1);
    let gaps = points.iter().step_by(stride).filter_map(|p| search.k(*p, k + 1).last().map(|n| n.distance()));
    median(gaps).unwrap_or(0.0).max(1e-6)
}

/// Index of the point nearest to a place.
fn nearest_to(points: &[DVec3], place: DVec3) -> usize {
    let nearer = |i: usize, j: usize| points[i].distance_squared(place) < points[j].distance_squared(place);
    (0..points.len()).fold(0, |best, i| if nearer(i, best) { i } else { best })
}
