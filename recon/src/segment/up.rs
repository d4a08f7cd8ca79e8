//! Which way is up in a cloud.

use glam::DVec3;

/// The vertical of a cloud's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Up {
    /// Given.
    Axis(DVec3),
    /// Found among ±x, ±y, ±z.
    Auto,
}

/// Share of the points at each end that are compared.
const END_SHARE: f64 = 0.12;

impl Up {
    /// The unit vertical. Found: leaves stand above stems where both are known; else the end of the axis at which the
    /// plant is a thin stalk is down, judged by how little the points there spread sideways.
    pub(super) fn resolve(self, points: &[DVec3], is_stem: Option<&[bool]>) -> DVec3 {
        if let Self::Axis(up) = self {
            return up.normalize_or(DVec3::Z);
        }
        let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
        let score = |up: DVec3| match is_stem {
            Some(is_stem) => stalk_below_leaves(points, is_stem, up),
            None => -foot_spread(points, up),
        };
        axes.map(|up| (score(up), up))
            .fold((f64::NEG_INFINITY, DVec3::Z), |best, next| if next.0 > best.0 { next } else { best })
            .1
    }
}

/// How far the lowest stem points lie below the leaves, less how far aside: a stalk has its foot under the crown.
fn stalk_below_leaves(points: &[DVec3], is_stem: &[bool], up: DVec3) -> f64 {
    let centre = |wanted: bool| {
        let chosen: Vec<DVec3> = points.iter().zip(is_stem).filter(|(_, s)| **s == wanted).map(|(p, _)| *p).collect();
        chosen.iter().copied().sum::<DVec3>() / chosen.len().max(1) as f64
    };
    let leaves = centre(false);
    let stems: Vec<DVec3> = points.iter().zip(is_stem).filter(|(_, s)| **s).map(|(p, _)| *p).collect();
    let foot = end(&stems, -up);
    let below = leaves - foot;
    2.0 * below.dot(up) - below.length()
}

/// Sideways spread of the lowest points, as a share of the spread of all.
fn foot_spread(points: &[DVec3], up: DVec3) -> f64 {
    let spread = |chosen: &[DVec3]| {
        let centre = chosen.iter().copied().sum::<DVec3>() / chosen.len().max(1) as f64;
        (chosen.iter().map(|p| (*p - centre).reject_from(up).length_squared()).sum::<f64>()
            / chosen.len().max(1) as f64)
            .sqrt()
    };
    spread(&lowest(points, up)) / spread(points).max(1e-12)
}

fn lowest(points: &[DVec3], up: DVec3) -> Vec<DVec3> {
    let heights = points.iter().map(|p| p.dot(up));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    points.iter().copied().filter(|p| p.dot(up) <= low + END_SHARE * (high - low)).collect()
}

fn end(points: &[DVec3], along: DVec3) -> DVec3 {
    let far = lowest(points, -along);
    far.iter().copied().sum::<DVec3>() / far.len().max(1) as f64
}
