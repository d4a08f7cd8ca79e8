//! Where organs hang: stems that stand already.

use glam::{DQuat, DVec3};

use super::stem::{StemFit, distance_to_path, mean, nearest_on};
use crate::model::Species;
use crate::model::kinematics::{Similarity, attachment};
use crate::model::stem::{BONES, StemCurve};

/// Share of an organ's points, nearest to its parent, that say where it is attached.
const FOOT_SHARE: f64 = 0.03;
/// Most points that say so.
const MAX_FOOT: usize = 30;

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
        mean_of_first(points, |p| distance_to_path(p, &self.path))
    }
}

/// Mean of the lowest points.
pub(super) fn lowest(points: &[DVec3], up: DVec3) -> DVec3 {
    mean_of_first(points, |p| p.dot(up))
}

fn mean_of_first(points: &[DVec3], key: impl Fn(DVec3) -> f64) -> DVec3 {
    let mut order: Vec<(f64, DVec3)> = points.iter().map(|p| (key(*p), *p)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.truncate(((points.len() as f64 * FOOT_SHARE) as usize).clamp(1, MAX_FOOT));
    DVec3::from_array([0, 1, 2].map(|axis| mean(order.iter().map(|(_, p)| p[axis]))))
}

/// Rotation of a child relative to its joint, w >= 0.
pub(super) fn relative(joint: DQuat, child: DQuat) -> DQuat {
    let q = (joint.inverse() * child).normalize();
    if q.w < 0.0 { -q } else { q }
}
