//! One stem alone: its course from its points, then pose, length and bends (spec/reconstruction.md "Fitting").

use glam::{DQuat, DVec3};
use nalgebra::DVector;

use super::centreline::{angles_along, course, length, resample};
use super::solver::{Normal, minimise};
use crate::model::Species;
use crate::model::stem::{POINTS, gauge};

/// Slices of a stem's course: as many as control points would leave slices empty on short stems.
const SLICES: usize = 12;
/// The distance to the axis below which this share of the points lies is the radius: on a clean scan every share says
/// the same, and points of neighbouring organs lie outside.
const RADIUS_QUANTILE: f64 = 0.25;

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
    /// Mean distance of the points to the tube's axis less its radius, metres.
    pub residual: f64,
    pub converged: bool,
}

#[derive(Clone)]
struct State {
    rotation: DQuat,
    log_length: f64,
    gamma: Vec<f64>,
}

/// Fits a stem that starts at `base`.
pub(super) fn fit(points: &[DVec3], base: DVec3, species: &Species) -> StemFit {
    let path = resample(&course(points, base, SLICES), POINTS);
    fit_path(&path, points, species)
}

/// Fits a stem along a known path (a skeleton, or a bridge over a gap, which has no points of its own).
pub(super) fn fit_path(path: &[DVec3], points: &[DVec3], species: &Species) -> StemFit {
    let ranges = &species.ranges;
    let target = resample(path, POINTS);
    let base = target[0];
    let first = DQuat::from_rotation_arc(DVec3::Y, (target[1] - base).normalize_or(DVec3::Z));
    let angles = DVector::from_vec(angles_along(&target, first));
    let metres = ranges.stem_length.clamp(length(&target));
    let mut state =
        State { rotation: first, log_length: metres.ln(), gamma: clipped(species.stem.deform.project(&angles)) };
    let bends = species.stem.deform.rank();
    // The bends' prior: 1 σ may cost as much as missing every control point by 0.5 % of the length.
    let prior = (0.005 * metres).powi(2);
    let converged = minimise(
        &mut state,
        12,
        |state| {
            let jacobian = species.stem.jacobian(&state.gamma);
            let s = state.log_length.exp();
            let mut normal = Normal::new(4 + bends);
            for (n, goal) in target.iter().enumerate().skip(1) {
                let at = state.rotation * (jacobian.points[n] * s);
                let miss = base + at - *goal;
                let columns: Vec<DVec3> =
                    (0..bends).map(|k| state.rotation * (jacobian.derivatives[n * bends + k] * s)).collect();
                for axis in DVec3::AXES {
                    let turn = at.cross(axis);
                    let mut row = vec![turn.x, turn.y, turn.z, at.dot(axis)];
                    row.extend(columns.iter().map(|c| c.dot(axis)));
                    normal.add(miss.dot(axis), &row, 1.0 / POINTS as f64);
                }
            }
            for (k, c) in state.gamma.iter().enumerate() {
                normal.prior(4 + k, *c, prior / POINTS as f64);
            }
            normal
        },
        |state, step| State {
            rotation: (DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2])) * state.rotation).normalize(),
            log_length: (state.log_length + step[3]).clamp(ranges.stem_length.min.ln(), ranges.stem_length.max.ln()),
            gamma: clipped(state.gamma.iter().enumerate().map(|(k, c)| c + step[4 + k]).collect()),
        },
    );
    let s = state.log_length.exp();
    let raw = species.stem.jacobian(&state.gamma).points;
    let axis: Vec<DVec3> = raw.iter().map(|p| base + state.rotation * (*p * s)).collect();
    let offsets: Vec<f64> = points.iter().map(|p| distance_to_path(*p, &axis)).collect();
    let radius = ranges.stem_radius.clamp(quantile(offsets.clone(), RADIUS_QUANTILE).unwrap_or(ranges.stem_radius.min));
    let residual = mean(offsets.iter().map(|d| (d - radius).abs()));
    let rotation = (state.rotation * gauge(&raw).inverse()).normalize();
    StemFit { rotation, length: s, gamma: state.gamma, radius, residual, converged }
}

/// Coefficients inside the model: |c| <= 3 σ.
pub(super) fn clipped(c: Vec<f64>) -> Vec<f64> {
    c.into_iter().map(|c| c.clamp(-3.0, 3.0)).collect()
}

/// Distance of a point to a polyline.
pub(super) fn distance_to_path(p: DVec3, path: &[DVec3]) -> f64 {
    path.windows(2).map(|w| p.distance(nearest_on(p, w[0], w[1]).1)).fold(f64::INFINITY, f64::min)
}

/// The parameter in 0..=1 and place of the point of a segment nearest to `p`.
pub(super) fn nearest_on(p: DVec3, a: DVec3, b: DVec3) -> (f64, DVec3) {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (t, a + along * t)
}

/// Median, `None` of nothing.
pub(crate) fn median(x: Vec<f64>) -> Option<f64> {
    quantile(x, 0.5)
}

fn quantile(mut x: Vec<f64>, share: f64) -> Option<f64> {
    x.sort_by(f64::total_cmp);
    x.get((x.len() as f64 * share) as usize).copied()
}

/// Mean, 0 of nothing.
pub(super) fn mean(x: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = x.len().max(1);
    x.sum::<f64>() / n as f64
}
