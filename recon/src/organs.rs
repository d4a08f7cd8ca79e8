//! A cloud divided into organs and the tree they form: what fitting starts from.

use glam::DVec3;

use crate::model::OrganKind;

/// The points of one organ.
#[derive(Clone, Debug, PartialEq)]
pub struct OrganCloud {
    /// What it is.
    pub kind: OrganKind,
    /// Its points, metres.
    pub points: Vec<DVec3>,
    /// Index of each point in the cloud it came from.
    pub source: Vec<u32>,
}

/// Organs with their parents; parents stand before children, organ 0 is the main stem.
#[derive(Clone, Debug, PartialEq)]
pub struct OrganTree {
    /// The organs.
    pub organs: Vec<OrganCloud>,
    /// Parent of each, `None` for organ 0 alone.
    pub parent: Vec<Option<usize>>,
}

/// Where a plant's metric scale comes from (spec/appliance.md "Store"); with `None` metric traits are withheld.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScaleSource {
    /// A calibrated stereo pair.
    Stereo,
    /// The rig's known height above the ground.
    GroundPlane,
    /// A target of known size.
    Target,
    /// A depth network that predicts metres.
    MetricModel,
    /// A cloud whose unit was given.
    Input,
    /// Unknown.
    None,
}
