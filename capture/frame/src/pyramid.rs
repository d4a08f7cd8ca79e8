use crate::Semantic;

/// How many of the level below, and of their own, points of a level look at.
pub const NEIGHBOURS: usize = 16;
/// How many points of the finest level each point's answer comes from.
pub const ABOVE: usize = 3;
/// Numbers that say what the surface about a point is like.
pub const LOCAL: usize = 6;

/// A cloud at several coarsenesses, and who lies near whom: what a network over points takes (`demeter_recon::pyramid`
/// makes it, `demeter_models::Organ3d` takes it).
///
/// Coordinates are in cells of level 1 and count from the middle of the cloud's foot, z up. Indices are those of the
/// level named; where a level has too few points, the farthest is repeated.
#[derive(Clone, Debug, PartialEq)]
pub struct PointPyramid {
    /// All points, in the caller's order.
    pub points: Vec<[f32; 3]>,
    /// For each point the nearest ones of level 1.
    pub up: Vec<[i64; ABOVE]>,
    /// Level 0, the finest.
    pub finest: Vec<[f32; 3]>,
    /// Levels 1, 2 and 3, each with fewer points.
    pub levels: [PyramidLevel; 3],
    /// For each point of level 1: linearity, planarity and scattering of what lies about it, the sizes of the vertical
    /// parts of its normal and of its main axis, and the cell's size as a share of the cloud's diagonal.
    pub local: Vec<[f32; LOCAL]>,
}

/// One level of a [`PointPyramid`].
#[derive(Clone, Debug, PartialEq)]
pub struct PyramidLevel {
    /// Its points.
    pub points: Vec<[f32; 3]>,
    /// For each the nearest ones of the level below.
    pub below: Vec<[i64; NEIGHBOURS]>,
    /// For each the nearest ones of its own level, itself first.
    pub beside: Vec<[i64; NEIGHBOURS]>,
    /// For each the point of the level above whose cell it lies in; empty at the last level.
    pub parent: Vec<i64>,
}

/// What a network says of a cloud, one entry a point, in the caller's order.
#[derive(Clone, Debug, PartialEq)]
pub struct PointMaps {
    /// Probability of each class, in the order of [`PointMaps::CLASSES`]; they sum to 1.
    pub probabilities: Vec<[f32; 3]>,
    /// Truncated inverse distance δ / max(d, δ) to the nearest point of another instance, δ being 1 % of the diagonal of
    /// the cloud's bounding box (spec/reconstruction.md, "Points to organs").
    pub boundary: Vec<f32>,
}

impl PointMaps {
    /// The classes of a point, in order.
    pub const CLASSES: [Semantic; 3] = [Semantic::Leaf, Semantic::Stem, Semantic::MainStem];
}
