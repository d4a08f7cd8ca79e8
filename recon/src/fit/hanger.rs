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
/// Shares of the points that say where an organ begins, see [`first`].
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

    /// The fraction d at which an organ leaves the stem's axis: where its points next to the stem begin, and from there
    /// back along their course as far as they stay off the axis. Leaves that leave at a small angle start well above
    /// where their first points are nearest.
    pub(super) fn root(&self, points: &[DVec3]) -> f64 {
        let near = lowest(points, |p| distance_to_path(p, &self.path), ROOT_SHARE, MIN_ROOT, usize::MAX);
        let (centre, away) = (middle(&near), mean(near.iter().map(|(away, _)| away)).unwrap_or(0.0));
        let course: DVec3 = near.iter().map(|(a, p)| (*p - centre) * (a - away)).sum();
        let course = course.normalize_or_zero();
        let begins = centre + course * first(near.iter().map(|(_, p)| (*p - centre).dot(course)).collect(), END_SHARES);
        let (at, along) = self.place(self.nearest(centre));
        let out = (centre - at).reject_from_normalized(along).normalize_or_zero();
        // Points that reach the axis begin there, however far from it the middle of the first of them is.
        let off = (begins - at).dot(out).min(first(near.iter().map(|(away, _)| *away).collect(), END_SHARES));
        let slope = if course.dot(out) > 0.0 { course / course.dot(out) } else { DVec3::ZERO };
        self.nearest(begins - slope.clamp_length_max(MAX_SLOPE) * off.max(0.0))
    }

    /// The place at d and the unit direction of the stem there.
    fn place(&self, d: f64) -> (DVec3, DVec3) {
        let bone = ((d * BONES as f64) as usize).min(BONES - 1);
        let (from, to) = (self.path[bone], self.path[bone + 1]);
        (from.lerp(to, d * BONES as f64 - bone as f64), (to - from).normalize_or_zero())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::stem::fit_path;
    use crate::species::shipped;

    /// A blade of 40 cm that leaves an upright stem of 2 cm at a height of 0.4 m, rising at `angle` from it.
    fn blade(angle: f64) -> Vec<DVec3> {
        let (along, across) = (DVec3::new(angle.sin(), 0.0, angle.cos()), DVec3::Y);
        let at = |i: usize, j: usize| along * (i as f64 / 400.0) + across * (0.002 * (j as f64 - 10.0));
        (0..160).flat_map(|i| (0..21).map(move |j| DVec3::Z * 0.4 + at(i, j))).collect()
    }

    #[test]
    fn roots_are_where_blades_leave_the_axis_seen_from_it_or_from_the_surface() {
        let species = shipped("maize").expect("listed").expect("valid");
        let mut stem = fit_path(&[DVec3::ZERO, DVec3::Z], &species);
        stem.radius = 0.01;
        let hanger = Hanger::of(&stem, DVec3::ZERO, &species);
        for degrees in [20.0_f64, 40.0, 70.0] {
            let whole = blade(degrees.to_radians());
            let outside: Vec<DVec3> = whole.iter().copied().filter(|p| p.truncate().length() > stem.radius).collect();
            let (from_axis, from_surface) = (hanger.root(&whole), hanger.root(&outside));
            assert!((from_axis - 0.4).abs() < 0.004, "{degrees}: {from_axis}");
            assert!((from_surface - 0.4).abs() < 0.01, "{degrees}: {from_surface}");
        }
    }
}
