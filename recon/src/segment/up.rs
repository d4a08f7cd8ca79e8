//! Which way is up in a cloud.

use glam::DVec3;

use super::check;
use super::foot::{self, Foot};

/// The vertical of a cloud's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Up {
    /// Given.
    Axis(DVec3),
    /// Found among ±x, ±y, ±z.
    Auto,
}

impl Up {
    /// The unit vertical of a cloud of which nothing else is known; z of one that is no plant.
    #[must_use]
    pub fn of(self, points: &[DVec3]) -> DVec3 {
        check(points).map_or(DVec3::Z, |()| self.resolve(points, None).0)
    }

    /// The unit vertical, and the foot. Found: the axis nearest to the direction in which the stalk leaves its foot.
    pub(super) fn resolve(self, points: &[DVec3], is_stem: Option<&[bool]>) -> (DVec3, Foot) {
        match self {
            Self::Axis(up) => {
                let up = up.normalize_or(DVec3::Z);
                (up, foot::find(points, is_stem, Some(up)))
            }
            Self::Auto => {
                let foot = foot::find(points, is_stem, None);
                let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
                let along = |axis: DVec3| axis.dot(foot.direction);
                (axes.fold(DVec3::Z, |best, axis| if along(axis) > along(best) { axis } else { best }), foot)
            }
        }
    }
}
