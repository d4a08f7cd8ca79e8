//! A blade hardly larger than the noise of its points: they are draws from its surface, even by area, that noise has
//! smeared. Their likelihood finds the blade behind the noise, where distances to a surface would swell it by the noise.

#[cfg(test)]
mod tests;

use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use super::crowd::Crowd;
use super::data::Data;
use super::equations::Rows;
use super::level::{INDEPENDENT, priors};
use super::seen::Seen;
use super::sheet::Sheet;
use super::state::State;
use super::{COARSE, FINE, LeafFit, finished, uncertainty};
use crate::fit::solver::{Normal, minimise};
use crate::model::Species;
use crate::model::leaf::Lattice;
use crate::traits::Sigmas;

/// Square root of the area in standard deviations of the noise below which a blade is fitted as a smeared one (where
/// its area comes out no worse, by plants grown for it).
const SMALL: f64 = 25.0;
/// Most standard deviations of the noise between rows of nodes: farther apart they are no surface but a row of blobs.
const STEP: f64 = 1.5;
/// Lattices, coarsest first.
const LATTICES: [Lattice; 3] = [COARSE, FINE, Lattice::every(1, 3)];
/// Most points that are looked at, and most steps.
const MAX_POINTS: usize = 400;
const STEPS: usize = 15;
/// Standard deviations of the noise beyond which a point is a stray.
const STRAY: f64 = 4.0;
/// How far a blade starts from what it hangs on, whose end is as noisy, in standard deviations of the noise (a guess).
const BASE: f64 = 1.0;

/// A blade of a plant as its cloud has it.
#[derive(Clone, Copy)]
pub(in crate::fit) struct Cloud<'a> {
    pub points: &'a [DVec3],
    /// Of how many the points are a part.
    pub count: usize,
    /// Where it hangs.
    pub base: DVec3,
    pub up: DVec3,
}

/// Fits a blade again that the noise of its crowd smears; `None` when it is too large for that.
pub(in crate::fit) fn again(fit: &LeafFit, cloud: Cloud<'_>, species: &Species, crowd: Crowd) -> Option<LeafFit> {
    let step = |lattice: &Lattice| fit.length / (lattice.rows() - 1) as f64;
    let lattice = LATTICES.into_iter().find(|lattice| step(lattice) <= STEP * crowd.noise)?;
    if fit.area.sqrt() > SMALL * crowd.noise {
        return None;
    }
    let data = Data::thinned(cloud.points, MAX_POINTS);
    let smeared = Smeared { points: &data.points, cloud, species, lattice, crowd };
    let mut state = fit.state.clone();
    let apply = |state: &State, step: &_| state.stepped(step, species);
    let converged = minimise(&mut state, STEPS, |state| smeared.normal(state), apply);
    let sigmas = smeared.sigmas(&state);
    let seen = Seen::of(state.sheet(species, FINE), &data, None);
    Some(LeafFit { converged, sigmas, ..finished(state, &seen, &data, species) })
}

struct Smeared<'a> {
    /// Some of the cloud's.
    points: &'a [DVec3],
    cloud: Cloud<'a>,
    species: &'a Species,
    lattice: Lattice,
    crowd: Crowd,
}

impl Smeared<'_> {
    /// The uncertainty of the blade's traits, when `state` is where the fit ends.
    fn sigmas(&self, state: &State) -> Sigmas {
        let (sheet, jacobian) = state.linearised(self.species, self.lattice);
        uncertainty::sigmas(self.normal(state).h, &Rows::new(state, &sheet, &jacobian, true), self.cloud.up)
    }

    /// Minus twice the logarithm of the posterior; its curvature is the points' information, as in Fisher scoring.
    fn normal(&self, state: &State) -> Normal {
        let (sheet, jacobian) = state.linearised(self.species, self.lattice);
        let rows = Rows::new(state, &sheet, &jacobian, true);
        let by_places = rows.by_places();
        let share = (INDEPENDENT / self.points.len() as f64).min(1.0);
        let (log, scores) = self.scores(&sheet);
        let scores = &by_places * scores;
        let mut normal = Normal {
            g: scores.column_sum() * -share,
            h: &scores * scores.transpose() * share,
            cost: -2.0 * share * log,
        };
        // The blade should hold as many points as others of its area do.
        let area: f64 = sheet.areas.iter().sum();
        let by_area = flat(sheet.area_gradient(&vec![1.0 / area; sheet.areas.len()]));
        let by_area = by_places * DVector::from_vec(by_area);
        let count = self.cloud.count as f64;
        let miss = area.ln() + self.crowd.log_density - count.ln();
        normal.add(miss, by_area.as_slice(), 1.0 / (self.crowd.spread.powi(2) + 1.0 / count));
        priors(&mut normal, state, self.species, 1.0);
        for (axis, off) in (state.base - self.cloud.base).to_array().into_iter().enumerate() {
            normal.prior(rows.parameters - 3 + axis, off, (BASE * self.crowd.noise).powi(-2));
        }
        normal
    }

    /// The logarithm of the likelihood, less a constant, and its derivative by the nodes' coordinates: a column for each
    /// point's part of it.
    fn scores(&self, sheet: &Sheet) -> (f64, DMatrix<f64>) {
        let precision = self.crowd.noise.powi(-2);
        let area: f64 = sheet.areas.iter().sum();
        let stray = (-STRAY * STRAY / 2.0).exp();
        let (mut log, mut scores) = (0.0, Vec::new());
        for p in self.points {
            let blurred = |q: &DVec3| (-q.distance_squared(*p) * precision / 2.0).exp();
            let near: Vec<f64> = sheet.points.iter().map(blurred).collect();
            let density = near.iter().zip(&sheet.areas).map(|(near, area)| (near + stray) * area).sum::<f64>();
            log += (density / area).ln();
            let by_areas: Vec<f64> = near.iter().map(|near| (near + stray) / density - 1.0 / area).collect();
            let mut score = sheet.area_gradient(&by_areas);
            for (n, by) in score.iter_mut().enumerate() {
                *by += (*p - sheet.points[n]) * (near[n] * sheet.areas[n] * precision / density);
            }
            scores.extend(flat(score));
        }
        (log, DMatrix::from_vec(3 * sheet.points.len(), self.points.len(), scores))
    }
}

fn flat(vectors: Vec<DVec3>) -> Vec<f64> {
    vectors.into_iter().flat_map(|v| v.to_array()).collect()
}
