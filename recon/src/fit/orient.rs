//! Directions out of points.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Vector3};

/// The rotation that takes each second point nearest to its first (Kabsch); `None` when the points do not tell.
pub(super) fn turn_onto(pairs: impl Iterator<Item = (DVec3, DVec3)>) -> Option<DQuat> {
    let vector = |p: DVec3| Vector3::new(p.x, p.y, p.z);
    let product: Matrix3<f64> = pairs.map(|(to, from)| vector(to) * vector(from).transpose()).sum();
    let svd = product.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut keep = Matrix3::identity();
    keep[(2, 2)] = (u * v_t).determinant().signum();
    let rotation = u * keep * v_t;
    let column = |k: usize| DVec3::new(rotation[(0, k)], rotation[(1, k)], rotation[(2, k)]);
    let turn = DQuat::from_mat3(&DMat3::from_cols(column(0), column(1), column(2))).normalize();
    turn.is_finite().then_some(turn)
}
