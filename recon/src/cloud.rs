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
