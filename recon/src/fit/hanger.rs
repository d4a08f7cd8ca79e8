//! Where organs hang: stems that stand already.

use glam::{DQuat, DVec3};

use super::stem::{StemFit, first};
use crate::model::Species;
use crate::model::kinematics::{Similarity, attachment};
use crate::model::stem::{BONES, StemCurve};
use crate::polyline::{distance_to_path, nearest_on};
use crate::statistics::mean;

/// Share of an organ's points, nearest to its parent, that say where it starts.
const FOOT_SHARE: f64 = 0.03;
/// Most points that say so.
const MAX_FOOT: usize = 30;
/// Share that says in which direction it leaves, and fewest points.
const ROOT_SHARE: f64 = 0.08;
const MIN_ROOT: usize = 8;
/// Metres that an organ goes on for each metre that it leaves its parent, at most: an angle of 15° between the two.
const MAX_SLOPE: f64 = 3.9;
/// Shares of the lowest points of a main stem, see [`first`].
const END_SHARES: [f64; 2] = [0.01, 0.02];

/// A stem in the world.
pub(super) struct Hanger {
    similarity: Similarity,
    curve: StemCurve,
    /// Control points in the world.
    path: Vec<DVec3>,
    /// Metres.
    pub radius: f64,
}

impl Hanger {
    pub(super) fn of(fit: &StemFit, base: DVec3, species: &Species) -> Self {
        let similarity = Similarity { rotation: fit.rotation, translation: base, scale: fit.length };
        let curve = species.stem.curve(&fit.gamma);
        let path = curve.points.iter().map(|x| similarity.point(*x)).collect();
        Self { similarity, curve, path, radius: fit.radius }
    }

    /// The fraction d of the place on the stem nearest to a point of the world.
    pub(super) fn nearest(&self, p: DVec3) -> f64 {
        let (mut best, mut d) = (f64::INFINITY, 0.0);
        for (i, pair) in self.path.windows(2).enumerate() {
            let (t, at) = nearest_on(p, pair[0], pair[1]);
            if at.distance_squared(p) < best {
                best = at.distance_squared(p);
                d = (i as f64 + t) / BONES as f64;
            }
        }
        d
    }

    /// The joint at d: where it is, how it is turned, and the size that what hangs there is relative to.
    pub(super) fn joint(&self, d: f64) -> Similarity {
        let (p, frame) = attachment(&self.curve, d);
        Similarity {
            rotation: self.similarity.rotation * frame,
            translation: self.similarity.point(p),
            scale: self.similarity.scale,
        }
    }

    /// Where an organ starts that hangs here: the mean of its points nearest to the stem.
    pub(super) fn foot(&self, points: &[DVec3]) -> DVec3 {
        middle(&lowest(points, |p| distance_to_path(p, &self.path), FOOT_SHARE, 1, MAX_FOOT))
    }

    /// The fraction d at which an organ that starts beside the stem leaves it: its points next to the stem, drawn on to
    /// the axis. Leaves that leave at a small angle start well above where their first points are nearest.
    pub(super) fn root(&self, points: &[DVec3]) -> f64 {
        let near = lowest(points, |p| distance_to_path(p, &self.path), ROOT_SHARE, MIN_ROOT, usize::MAX);
        let (centre, away) = (middle(&near), mean(near.iter().map(|(away, _)| away)).unwrap_or(0.0));
        let varies: f64 = near.iter().map(|(a, _)| (a - away).powi(2)).sum();
        let follows: DVec3 = near.iter().map(|(a, p)| (*p - centre) * (a - away)).sum();
        let slope = (follows / varies.max(f64::MIN_POSITIVE)).clamp_length_max(MAX_SLOPE);
        self.nearest(centre - slope * away)
    }
}

/// Where a main stem meets the ground: under the middle of its lowest points, where they begin.
pub(super) fn ground(points: &[DVec3], up: DVec3) -> DVec3 {
    let middle = middle(&lowest(points, |p| p.dot(up), FOOT_SHARE, 1, MAX_FOOT));
    middle + up * (first(points.iter().map(|p| p.dot(up)).collect(), END_SHARES) - middle.dot(up))
}

/// The share of the points with the lowest keys, with their keys.
fn lowest(points: &[DVec3], key: impl Fn(DVec3) -> f64, share: f64, least: usize, most: usize) -> Vec<(f64, DVec3)> {
    let mut order: Vec<(f64, DVec3)> = points.iter().map(|p| (key(*p), *p)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.truncate(((points.len() as f64 * share) as usize).clamp(least, most));
    order
}

fn middle(points: &[(f64, DVec3)]) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| mean(points.iter().map(|(_, p)| p[axis])).unwrap_or(0.0)))
}

/// Rotation of a child relative to its joint, w >= 0.
pub(super) fn relative(joint: DQuat, child: DQuat) -> DQuat {
    let q = (joint.inverse() * child).normalize();
    if q.w < 0.0 { -q } else { q }
}
