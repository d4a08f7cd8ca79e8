//! Which way is up in a cloud.

use glam::DVec3;

use crate::model::Habit;

/// The vertical of a cloud's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Up {
    /// Given.
    Axis(DVec3),
    /// Found among ±x, ±y, ±z.
    Auto,
}

/// Share of a stem's height that is its foot.
const FOOT_SHARE: f64 = 0.12;
/// Share of a plant's height that is its stalk where stems are not known.
const STALK_SHARE: f64 = 0.25;

impl Up {
    /// The unit vertical. Found: leaves stand above stems where both are known; else the end at which the plant is a
    /// thin stalk is down, and of a grass, whose leaves are thin too, the end under the plant's middle and its mass.
    pub(super) fn resolve(self, points: &[DVec3], is_stem: Option<&[bool]>, habit: Habit) -> DVec3 {
        if let Self::Axis(up) = self {
            return up.normalize_or(DVec3::Z);
        }
        let score = |up: DVec3| match (is_stem, habit) {
            (Some(is_stem), _) => stalk_below_leaves(points, is_stem, up),
            (None, Habit::Simple | Habit::Compound) => -stalk_spread(points, up),
            (None, Habit::Grass) => mean_height(points, up) - stalk_spread(points, up) - stalk_offset(points, up),
        };
        let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).map(|up| (score(up), up));
        axes.fold((f64::NEG_INFINITY, DVec3::Z), |best, next| if next.0 > best.0 { next } else { best }).1
    }
}

/// How far the lowest stem points lie below the leaves, less how far aside: a stalk has its foot under the crown.
fn stalk_below_leaves(points: &[DVec3], is_stem: &[bool], up: DVec3) -> f64 {
    let chosen = |wanted: bool| -> Vec<DVec3> {
        points.iter().zip(is_stem).filter(|(_, s)| **s == wanted).map(|(p, _)| *p).collect()
    };
    let below = mean(&chosen(false)) - mean(&lowest(&chosen(true), up, FOOT_SHARE));
    2.0 * below.dot(up) - below.length()
}

/// Sideways spread of the stalk, as a share of the spread of all.
fn stalk_spread(points: &[DVec3], up: DVec3) -> f64 {
    let sideways = |chosen: &[DVec3]| {
        let centre = mean(chosen);
        let squares = chosen.iter().map(|p| (*p - centre).reject_from(up).length_squared());
        (squares.sum::<f64>() / chosen.len().max(1) as f64).sqrt()
    };
    sideways(&lowest(points, up, STALK_SHARE)) / sideways(points).max(1e-12)
}

/// How far aside of the plant's middle its foot is, as a share of the points' spread.
fn stalk_offset(points: &[DVec3], up: DVec3) -> f64 {
    let centre = mean(points);
    let spread = points.iter().map(|p| p.distance_squared(centre)).sum::<f64>() / points.len().max(1) as f64;
    (mean(&lowest(points, up, FOOT_SHARE)) - centre).reject_from(up).length() / spread.sqrt().max(1e-12)
}

/// Height of the mean point, as a share of the plant's.
fn mean_height(points: &[DVec3], up: DVec3) -> f64 {
    let (low, high) = heights(points, up);
    (mean(points).dot(up) - low) / (high - low).max(1e-12)
}

fn heights(points: &[DVec3], up: DVec3) -> (f64, f64) {
    points.iter().map(|p| p.dot(up)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
}

fn lowest(points: &[DVec3], up: DVec3, share: f64) -> Vec<DVec3> {
    let (low, high) = heights(points, up);
    points.iter().copied().filter(|p| p.dot(up) <= low + share * (high - low)).collect()
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().copied().sum::<DVec3>() / points.len().max(1) as f64
}
