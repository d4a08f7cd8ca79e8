//! The volume of the convex hull.

use glam::DVec3;
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;

/// Cubic metres; 0 of points in one plane.
pub(super) fn volume(points: &[DVec3]) -> f64 {
    // Seen from one of them, so that a plant far from the origin keeps its digits.
    let Some(origin) = points.first() else { return 0.0 };
    let points: Vec<Vector> = points.iter().map(|p| (p - origin).to_array().into()).collect();
    let Ok((corners, faces)) = try_convex_hull(&points) else { return 0.0 };
    let tetrahedron = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|corner| DVec3::from_array(corners[corner as usize].into()));
        a.dot(b.cross(c)) / 6.0
    };
    faces.iter().map(tetrahedron).sum()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    fn box_of(size: DVec3, at: DVec3) -> Vec<DVec3> {
        (0..8).map(|k| at + size * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2))).collect()
    }

    #[test]
    fn boxes_have_their_volume_and_what_is_within_adds_none() {
        let (size, at) = (DVec3::new(0.2, 0.5, 1.0), DVec3::new(1e3, -1e3, 5.0));
        let corners = box_of(size, at);
        assert_relative_eq!(volume(&corners), 0.1, epsilon = 1e-9);
        let inside = box_of(size / 2.0, at + size / 4.0);
        assert_relative_eq!(volume(&[corners, inside].concat()), 0.1, epsilon = 1e-9);
    }

    #[test]
    fn what_has_no_body_has_no_volume() {
        assert_eq!(volume(&[]), 0.0);
        assert_eq!(volume(&[DVec3::ONE; 9]), 0.0);
        assert_relative_eq!(volume(&[DVec3::ZERO, DVec3::X, DVec3::X * 2.0]), 0.0, epsilon = 1e-12);
        assert_relative_eq!(volume(&box_of(DVec3::new(1.0, 1.0, 0.0), DVec3::Z)), 0.0, epsilon = 1e-9);
    }
}
