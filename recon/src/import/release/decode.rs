//! The release's own articulation, as measured on its plants: where each control point stands.
//!
//! Frames are computed anew on every posed stem: columns tangent, normal, binormal of its control points by central
//! differences, slerped between control points, and an organ's row vectors turn by `M_quat`, then into the frame. Its
//! lengths are divided by themselves plus 1e-6, so a frame is a rotation only roughly: up to a thousandth it goes into
//! a quaternion as it is, above that it is made orthogonal row by row. Both show in the vertices that the release
//! decodes (a stem of 4 mm turns its leaf by 0.2°), so both are done here.

use glam::{DMat3, DQuat, DVec3};

use super::bases::Bases;
use super::plant::{ReleaseForm, ReleaseOrgan, ReleasePlant};
use crate::model::stem::BONES;

/// Added to tangents' lengths before they divide, in the release's unit.
const EPSILON: f64 = 1e-6;
/// Frames whose determinant is further from 1 are made orthogonal.
const SKEW: f64 = 1e-3;
/// Smallest radius that the release draws, in its unit.
pub(super) const MIN_RADIUS: f64 = 0.0004;

impl ReleasePlant {
    /// Control points of every organ in the release's world (z up, base of the main stem at 0): 24 of a stem,
    /// 45 x 43 in our order of a leaf.
    #[must_use]
    pub fn decode(&self, bases: &Bases) -> Vec<Vec<DVec3>> {
        let mut world: Vec<Vec<DVec3>> = Vec::with_capacity(self.organs.len());
        for organ in &self.organs {
            let local = organ.local(bases);
            world.push(match organ.parent {
                // The main stem's quaternion is not used.
                None => local.into_iter().map(|p| p * organ.scale).collect(),
                Some(parent) => {
                    let (base, frame) = attachment(&world[parent], organ.d);
                    let rotation = frame * organ.rotation.inverse();
                    local.into_iter().map(|p| base + rotation * (p * organ.scale)).collect()
                }
            });
        }
        world
    }
}

impl ReleaseOrgan {
    /// Control points that the bases give in the organ's own frame.
    fn local(&self, bases: &Bases) -> Vec<DVec3> {
        match &self.form {
            ReleaseForm::Leaf(beta) => bases.leaf(&bases.flat(beta), &self.deform),
            ReleaseForm::Stem(_) => bases.stem(&self.deform),
        }
    }
}

/// Point and frame at d of a posed stem.
fn attachment(points: &[DVec3], d: f64) -> (DVec3, DQuat) {
    let at = d.clamp(0.0, 1.0) * BONES as f64;
    let i = (at as usize).min(BONES - 1);
    let (frames, t) = (frames(points), at - i as f64);
    (points[i].lerp(points[i + 1], t), frames[i].slerp(frames[i + 1], t))
}

fn frames(points: &[DVec3]) -> Vec<DQuat> {
    let tangents: Vec<DVec3> = gradient(points).into_iter().map(|g| g / (g.length() + EPSILON)).collect();
    let frame = |(tangent, turn): (&DVec3, DVec3)| {
        let normal = (turn - *tangent * turn.dot(*tangent)).normalize_or(tangent.any_orthonormal_vector());
        quaternion(DMat3::from_cols(*tangent, normal, tangent.cross(normal).normalize_or(DVec3::Z)))
    };
    tangents.iter().zip(gradient(&tangents)).map(frame).collect()
}

/// Central differences, one-sided at the ends.
fn gradient(x: &[DVec3]) -> Vec<DVec3> {
    let last = x.len() - 1;
    (0..=last)
        .map(|i| (x[(i + 1).min(last)] - x[i.saturating_sub(1)]) / if i % last == 0 { 1.0 } else { 2.0 })
        .collect()
}

/// The quaternion of a matrix that is nearly a rotation, from its largest component.
fn quaternion(matrix: DMat3) -> DQuat {
    let m = if (matrix.determinant() - 1.0).abs() > SKEW {
        let [a, b] = [matrix.row(0), matrix.row(1)];
        let a = a.normalize_or(DVec3::X);
        let b = b.reject_from_normalized(a).normalize_or(a.any_orthonormal_vector());
        DMat3::from_cols(a, b, a.cross(b)).transpose()
    } else {
        matrix
    };
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let candidates = [
        [y.z - z.y, z.x - x.z, x.y - y.x, 1.0 + x.x + y.y + z.z],
        [1.0 + x.x - y.y - z.z, x.y + y.x, z.x + x.z, y.z - z.y],
        [x.y + y.x, 1.0 - x.x + y.y - z.z, y.z + z.y, z.x - x.z],
        [z.x + x.z, y.z + z.y, 1.0 - x.x - y.y + z.z, x.y - y.x],
    ];
    // The one that divides by most: w, x, y or z.
    let own = [3, 0, 1, 2];
    let best = (0..4).max_by(|a, b| candidates[*a][own[*a]].total_cmp(&candidates[*b][own[*b]])).unwrap_or(0);
    DQuat::from_array(candidates[best]).normalize()
}
