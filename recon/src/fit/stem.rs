//! One stem alone: its course from its points, then pose, length and bends (spec/reconstruction.md "Fitting").

use glam::{DQuat, DVec3};
use nalgebra::DVector;

use super::centreline::{angles_along, course, resample};
use super::loss::Loss;
use super::solver::minimise;
use super::tube::{Rows, Tube, TubeData};
use crate::cloud::thinned;
use crate::model::Species;
use crate::model::stem::{BONES, POINTS, gauge};
use crate::polyline::{distance_to_path, path_length};
use crate::statistics::{mean, quantile};

/// Slices of a stem's course: as many as control points would leave slices empty on short stems.
const SLICES: usize = 12;
/// Most points that the course is found from.
const COURSE_POINTS: usize = 600;
/// The distance to the course below which this share of the points lies is the first guess of the radius: on a clean
/// scan every share says the same, and points of neighbouring organs lie outside.
const RADIUS_QUANTILE: f64 = 0.25;
/// Standard deviation of a course's control points, as a share of its length (a guess).
const COURSE_SIGMA: f64 = 0.005;
/// Steps onto the course, and of each round onto the points.
const STEPS: [usize; 2] = [8, 6];
/// Rounds onto the points: each judges their noise anew.
const ROUNDS: usize = 2;

/// A fitted stem in the world; its base is where it was told to be.
#[derive(Clone, Debug)]
pub(super) struct StemFit {
    /// world_from_organ rotation, gauged.
    pub rotation: DQuat,
    /// Path length, metres.
    pub length: f64,
    /// Deformation in σ.
    pub gamma: Vec<f64>,
    /// Radius, metres.
    pub radius: f64,
    /// Whether the points tell the radius: half a tube does, a strip along it does not.
    pub radius_known: bool,
    /// Mean distance of the points to the tube, metres.
    pub residual: f64,
    pub converged: bool,
}

/// Fits a stem that starts at `base`.
pub(super) fn fit(points: &[DVec3], base: DVec3, species: &Species) -> StemFit {
    let few = thinned(points, COURSE_POINTS);
    let mut tube = along(&course(&few, base, SLICES), species);
    let axis = Rows::of(&tube, species).axis;
    let offsets = few.iter().map(|p| distance_to_path(*p, &axis));
    let radius = quantile(offsets, RADIUS_QUANTILE).unwrap_or(0.0);
    tube.log_radius = species.ranges.stem_radius.clamp(radius).ln();
    let data = TubeData::new(points, &tube);
    let mut thin = tube.clone();
    let mut converged = onto(&mut tube, &data, species);
    let data = data.with_radius_held();
    let thin_converged = onto(&mut thin, &data, species);
    let radius_known = data.chamfer(&tube, species) <= data.chamfer(&thin, species);
    if !radius_known {
        (tube, converged) = (thin, thin_converged);
    }
    let misses = data.misses(&tube, species);
    StemFit { residual: mean(&misses).unwrap_or(0.0), radius_known, converged, ..StemFit::of(&tube, species) }
}

/// Moves a tube onto its points; true when that converged.
fn onto(tube: &mut Tube, data: &TubeData, species: &Species) -> bool {
    let mut converged = false;
    for _ in 0..ROUNDS {
        let sigma = data.noise(tube, species);
        let normal = |tube: &Tube| data.normal(tube, sigma, species).without_first(3);
        converged = minimise(tube, STEPS[1], normal, |tube, step| tube.stepped(step.as_slice(), &species.ranges));
    }
    converged
}

/// Fits a stem as thin as can be along a known path: a bridge over a gap, which has no points of its own.
pub(super) fn fit_path(path: &[DVec3], species: &Species) -> StemFit {
    StemFit::of(&along(path, species), species)
}

impl StemFit {
    pub(super) fn of(tube: &Tube, species: &Species) -> Self {
        let raw = species.stem.jacobian(&tube.gamma).points;
        Self {
            rotation: (tube.rotation * gauge(&raw).inverse()).normalize(),
            length: tube.metres(),
            gamma: tube.gamma.clone(),
            radius: tube.radius(),
            radius_known: false,
            residual: 0.0,
            converged: true,
        }
    }
}

/// The thinnest tube along a path.
fn along(path: &[DVec3], species: &Species) -> Tube {
    let ranges = &species.ranges;
    let target = resample(path, POINTS);
    let first = DQuat::from_rotation_arc(DVec3::Y, (target[1] - target[0]).normalize_or(DVec3::Z));
    let angles = DVector::from_vec(angles_along(&target, first));
    let metres = ranges.stem_length.clamp(path_length(target.iter().copied()));
    let mut tube = Tube {
        base: target[0],
        rotation: first,
        log_length: metres.ln(),
        gamma: clipped(species.stem.deform.project(&angles)),
        log_radius: ranges.stem_radius.min.ln(),
    };
    let loss = Loss { weight: (COURSE_SIGMA * metres).powi(-2), cost: 0.0 };
    let normal = |tube: &Tube| {
        let mut rows = Rows::of(tube, species);
        for bone in 0..BONES {
            let miss = rows.place(bone, 1.0) - target[bone + 1];
            for axis in DVec3::AXES {
                let miss = miss.dot(axis);
                rows.pull((bone, 1.0), axis, miss, 0.0, Loss { cost: loss.weight * miss * miss, ..loss });
            }
        }
        rows.finish(tube.log_radius, 1.0).without_first(3)
    };
    minimise(&mut tube, STEPS[0], normal, |tube, step| tube.stepped(step.as_slice(), ranges));
    tube
}

/// Coefficients inside the model: |c| <= 3 σ.
pub(super) fn clipped(c: Vec<f64>) -> Vec<f64> {
    c.into_iter().map(|c| c.clamp(-3.0, 3.0)).collect()
}

/// Where points begin, from how far along each is: of even points, the first is as far before the share `near` of them
/// as that is before the share `far`. Resists strays and noise as the least of them does not.
pub(super) fn first(along: Vec<f64>, [near, far]: [f64; 2]) -> f64 {
    let least = along.iter().copied().fold(f64::INFINITY, f64::min);
    let [near, far] = [near, far].map(|share| quantile(&along, share).unwrap_or(0.0));
    (2.0 * near - far).max(least)
}
