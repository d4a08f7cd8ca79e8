//! Inverse kinematics: the joint angles that bend an organ's bones onto given control points (paper eq. 5 solved for
//! its angles). Exact where bones are as long as the points are apart; otherwise directions are met and lengths kept.

use glam::{DQuat, DVec2, DVec3};
use nalgebra::DVector;

use super::leaf::{self, ROWS, Side, VEIN, node, side_angle, vein_angle};
use super::stem;

/// The joint angles `[3700]` of a blade whose flat grid is `flat` `[45*43]` and whose bent one is `points` `[45*43]`.
#[must_use]
pub fn leaf_angles(flat: &[DVec2], points: &[DVec3]) -> DVector<f64> {
    let mut angles = DVector::zeros(leaf::ANGLES);
    let rest = |to: usize, from: usize| (flat[to] - flat[from]).extend(0.0);
    let mut frame = DQuat::IDENTITY;
    for i in 1..ROWS {
        let (to, from) = (node(i, VEIN), node(i - 1, VEIN));
        let w = turn(&mut frame, rest(to, from), points[to] - points[from], DVec3::Y);
        angles[vein_angle(i)] = w.x;
        angles[vein_angle(i) + 1] = w.z;
        if i == ROWS - 1 {
            break;
        }
        for side in Side::BOTH {
            let mut rib = frame;
            for k in 1..=VEIN {
                let (to, from) = (node(i, side.column(k)), node(i, side.column(k - 1)));
                let w = turn(&mut rib, rest(to, from), points[to] - points[from], DVec3::X);
                angles[side_angle(i, side, k)] = w.y;
                angles[side_angle(i, side, k) + 1] = w.z;
            }
        }
    }
    angles
}

/// The joint angles `[46]` of a stem whose control points are `points` `[24]`.
#[must_use]
pub fn stem_angles(points: &[DVec3]) -> DVector<f64> {
    let mut frame = DQuat::IDENTITY;
    let turns = points.windows(2).map(|p| turn(&mut frame, DVec3::Y, p[1] - p[0], DVec3::Y));
    DVector::from_iterator(stem::ANGLES, turns.flat_map(|w| [w.x, w.z]))
}

/// The rotation vector, orthogonal to `still`, that turns a bone's direction `rest` in `frame` to `to`; the frame
/// follows. Bones without length turn nothing.
fn turn(frame: &mut DQuat, rest: DVec3, to: DVec3, still: DVec3) -> DVec3 {
    let (Some(from), Some(to)) = (rest.try_normalize(), (frame.inverse() * to).try_normalize()) else {
        return DVec3::ZERO;
    };
    // An axis sees both directions under one angle when it is orthogonal to their difference.
    let axis = still.cross(to - from).try_normalize().unwrap_or_else(|| still.any_orthonormal_vector());
    let (a, b) = (from.reject_from_normalized(axis), to.reject_from_normalized(axis));
    let w = axis * a.cross(b).dot(axis).atan2(a.dot(b));
    *frame = (*frame * DQuat::from_scaled_axis(w)).normalize();
    w
}
