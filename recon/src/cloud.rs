//! Points as they come from scans or lifted views.

use glam::DVec3;

/// A point cloud in metres, z up unless its source said otherwise and was turned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Positions, metres.
    pub points: Vec<DVec3>,
    /// 8-bit R, G, B, one a point, when the source has colour.
    pub colours: Option<Vec<[u8; 3]>>,
    /// Organ labels, one a point, when the source has them: 0 = stems, 1.. = one leaf node each.
    pub labels: Option<Vec<i32>>,
}

/// Diagonal of the points' axis-aligned bounding box in metres, `None` without points.
#[must_use]
pub fn diagonal(points: &[DVec3]) -> Option<f64> {
    let low = points.iter().copied().reduce(DVec3::min)?;
    let high = points.iter().copied().reduce(DVec3::max)?;
    Some(low.distance(high))
}
