//! Lines through points.

use glam::DVec3;

/// Length of a line through points, 0 of fewer than two.
pub(crate) fn path_length(points: impl IntoIterator<Item = DVec3>) -> f64 {
    let mut points = points.into_iter();
    let Some(mut last) = points.next() else { return 0.0 };
    points.map(|p| std::mem::replace(&mut last, p).distance(p)).sum()
}

/// Distance of a point to a polyline, infinite when it has no segment.
pub(crate) fn distance_to_path(p: DVec3, path: &[DVec3]) -> f64 {
    path.windows(2).map(|w| p.distance(nearest_on(p, w[0], w[1]).1)).fold(f64::INFINITY, f64::min)
}

/// The parameter in 0..=1 and place of the point of a segment nearest to `p`.
pub(crate) fn nearest_on(p: DVec3, a: DVec3, b: DVec3) -> (f64, DVec3) {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (t, a + along * t)
}
