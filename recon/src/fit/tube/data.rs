//! What a stem's points say of a tube: they lie on its surface, so that half of it seen from one side, or a few rows
//! along it, are enough to find its axis and its radius.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::{Rows, Tube};
use crate::cloud::thinned;
use crate::fit::loss::Loss;
use crate::fit::solver::Normal;
use crate::fit::stem::first;
use crate::model::Species;
use crate::model::stem::{BONES, POINTS};
use crate::nearest::{Nearest, Neighbour};
use crate::polyline::nearest_on;
use crate::statistics::{deviation, mean, median};

/// Most points of one stem that steer it.
const MAX_POINTS: usize = 400;
/// Independent observations that a stem's points amount to: neighbours err together (a guess).
const INDEPENDENT: f64 = 100.0;
/// Shares of the points nearest to a stem's tip, see [`first`].
const END_SHARES: [f64; 2] = [0.02, 0.04];
/// Least standard deviation of points about a tube, as a share of its length: stems are not quite round (a guess).
const NEAR: f64 = 0.0005;
/// Directions about the axis in which a tube's surface looks for points.
const SIDES: usize = 8;
/// Points within this many times their spacing of the surface lie beside it.
const BESIDE: f64 = 3.0;

/// A stem's points, prepared once.
pub(in crate::fit) struct TubeData {
    points: Vec<DVec3>,
    search: Nearest,
    /// Distance to the third neighbour (stems of sparse scans are single rows), metres: what one cannot see between.
    spacing: f64,
    /// First guess of the radius, ln metres.
    log_radius: f64,
    /// How firmly the radius is held to the guess: 1 for a guess that may be wrong e times.
    stiffness: f64,
    /// Where the stem starts: along its axis it stays there.
    base: DVec3,
}

/// Where a point lies along a tube.
struct Beside {
    bone: usize,
    t: f64,
    /// From the point to the axis.
    off: DVec3,
    /// Metres from the base along the axis, beyond the ends too.
    along: f64,
}

impl TubeData {
    /// `start` is the tube as first guessed.
    pub(in crate::fit) fn new(points: &[DVec3], start: &Tube) -> Self {
        let points = thinned(points, MAX_POINTS);
        let search = Nearest::of(&points);
        let apart = |p: &DVec3| search.k(*p, 4).last().map(Neighbour::distance);
        let spacing = median(points.iter().step_by(5).filter_map(apart)).unwrap_or(0.0).max(1e-6);
        Self { points, search, spacing, log_radius: start.log_radius, stiffness: 1.0, base: start.base }
    }

    /// The same with the radius as first guessed, whatever the points say.
    pub(in crate::fit) fn with_radius_held(self) -> Self {
        Self { stiffness: 1e9, ..self }
    }

    /// Mean distance of the points from the surface and half that of the surface from the points, metres: it tells a
    /// tube seen from one side, half of whose surface has no points, from a strip of noise beside too wide a tube.
    pub(in crate::fit) fn chamfer(&self, tube: &Tube, species: &Species) -> f64 {
        let rows = Rows::of(tube, species);
        let to_surface = mean(self.beside(&rows).map(|b| (b.off.length() - tube.radius()).abs())).unwrap_or(0.0);
        let ring = |bone: usize| {
            let (at, along) = (rows.place(bone, 0.5), rows.direction(bone));
            let side =
                (tube.rotation * DVec3::X).reject_from_normalized(along).normalize_or(along.any_orthonormal_vector());
            let turn = move |k: usize| DQuat::from_axis_angle(along, TAU * k as f64 / SIDES as f64);
            (0..SIDES).map(move |k| at + turn(k) * side * tube.radius())
        };
        let surface: Vec<DVec3> = (0..BONES).flat_map(ring).collect();
        let to_points = |p: &DVec3| self.search.one(*p).map_or(0.0, |n| n.distance());
        to_surface + mean(surface.iter().map(to_points)).unwrap_or(0.0) / 2.0
    }

    fn beside<'a>(&'a self, rows: &'a Rows<'_>) -> impl ExactSizeIterator<Item = Beside> + 'a {
        self.points.iter().map(|p| {
            let mut best = Beside { bone: 0, t: 0.0, off: DVec3::INFINITY, along: 0.0 };
            for bone in 0..BONES {
                let (t, at) = nearest_on(*p, rows.axis[bone], rows.axis[bone + 1]);
                if at.distance_squared(*p) < best.off.length_squared() {
                    best = Beside { bone, t, off: at - *p, along: 0.0 };
                }
            }
            best.along = rows.along(best.bone, best.t) - best.off.dot(rows.direction(best.bone));
            best
        })
    }

    /// Distances of the points from the tube's surface, metres; those beyond its ends are left out.
    pub(in crate::fit) fn misses(&self, tube: &Tube, species: &Species) -> Vec<f64> {
        let rows = Rows::of(tube, species);
        let inside = self.beside(&rows).filter(|b| (0.0..=tube.metres()).contains(&b.along));
        inside.map(|b| (b.off.length() - tube.radius()).abs()).collect()
    }

    /// Standard deviation of the points about the tube, metres.
    pub(in crate::fit) fn noise(&self, tube: &Tube, species: &Species) -> f64 {
        let noise = deviation(self.misses(tube, species));
        noise.max(NEAR * tube.metres())
    }

    /// The normal equations at a tube, in units of `sigma`.
    pub(in crate::fit) fn normal(&self, tube: &Tube, sigma: f64, species: &Species) -> Normal {
        let mut rows = Rows::of(tube, species);
        let beside: Vec<Beside> = self.beside(&rows).collect();
        let radius = tube.radius();
        let share = INDEPENDENT / self.points.len().max(1) as f64;
        for b in &beside {
            let distance = b.off.length();
            // A point on the axis pulls nowhere; beyond the ends it says where they are, below.
            if distance > 0.0 && (0.0..=tube.metres()).contains(&b.along) {
                let miss = distance - radius;
                rows.pull((b.bone, b.t), b.off / distance, miss, -radius, Loss::huber(miss, sigma).times(share));
            }
        }
        let share = INDEPENDENT / POINTS as f64;
        let (foot, tip) = (rows.direction(0), rows.direction(BONES - 1));
        let end_sigma = sigma.max(self.spacing / 2.0);
        let mut end = |bone: usize, t: f64, direction: DVec3, miss: f64| {
            rows.pull((bone, t), direction, miss, 0.0, Loss::huber(miss, end_sigma).times(share));
        };
        let beyond = tube.metres() + first(beside.iter().map(|b| -b.along).collect(), END_SHARES);
        end(BONES - 1, 1.0, tip, beyond);
        end(0, 0.0, foot, (tube.base - self.base).dot(foot));
        // The axis stays where points are beside it; the radius is no matter here, so that gaps do not swell stems.
        let reach = self.log_radius.exp() + BESIDE * self.spacing;
        for bone in 0..BONES - 1 {
            let at = rows.place(bone, 1.0);
            let Some(found) = self.search.one(at) else { continue };
            let miss = found.distance() - reach;
            if miss > 0.0 {
                let direction = (at - self.points[found.index]) / found.distance();
                rows.pull((bone, 1.0), direction, miss, 0.0, Loss::huber(miss, sigma).times(share));
            }
        }
        rows.finish(self.log_radius, self.stiffness)
    }
}
