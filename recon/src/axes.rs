//! Principal axes of points.

use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

/// The middle of some points and the directions along which they spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PrincipalAxes {
    /// Mean of the points; the origin when there are none.
    pub centre: DVec3,
    /// Unit axes as columns, widest spread first.
    pub axes: DMat3,
    /// Standard deviation along each axis, in the points' unit.
    pub deviation: [f64; 3],
}

impl PrincipalAxes {
    pub(crate) fn of(points: impl Iterator<Item = DVec3> + Clone) -> Self {
        let count = points.clone().count().max(1) as f64;
        let centre = points.clone().sum::<DVec3>() / count;
        let mut spread = DMat3::ZERO;
        for p in points {
            let d = p - centre;
            spread += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        // The eigenvalue iteration would not end on numbers that overflowed.
        let spread = if spread.is_finite() { spread / count } else { DMat3::ZERO };
        let eigen = Matrix3::from_column_slice(&spread.to_cols_array()).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let axis = |k: usize| DVec3::from_array(std::array::from_fn(|i| eigen.eigenvectors[(i, k)]));
        Self {
            centre,
            axes: DMat3::from_cols(axis(order[0]), axis(order[1]), axis(order[2])),
            deviation: order.map(|k| eigen.eigenvalues[k].max(0.0).sqrt()),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        /// A turned and moved box has the box's own axes and deviations.
        #[test]
        fn a_boxes_axes_turn_with_it(turn in prop::array::uniform3(-2.0..2.0_f64), shift in prop::array::uniform3(-5.0..5.0_f64)) {
            let turn = DQuat::from_scaled_axis(DVec3::from_array(turn));
            let half = DVec3::new(0.3, 2.0, 1.0);
            let corners = (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.0 - 1.0);
            let points = corners.map(|c| DVec3::from_array(shift) + turn * (c * half));
            let found = PrincipalAxes::of(points);
            prop_assert!(found.centre.distance(DVec3::from_array(shift)) < 1e-12);
            for (k, (axis, deviation)) in [(DVec3::Y, 2.0), (DVec3::Z, 1.0), (DVec3::X, 0.3)].into_iter().enumerate() {
                prop_assert!((found.axes.col(k).dot(turn * axis).abs() - 1.0).abs() < 1e-9);
                prop_assert!((found.deviation[k] - deviation).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn no_points_have_axes_all_the_same() {
        let none = PrincipalAxes::of(std::iter::empty());
        assert_eq!((none.centre, none.deviation), (DVec3::ZERO, [0.0; 3]));
        assert!(none.axes.determinant().abs() > 0.99);
    }
}
