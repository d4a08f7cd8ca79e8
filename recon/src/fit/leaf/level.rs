//! The cost of a blade, linearised.

use glam::DVec3;

use super::data::{BESIDE, Data};
use super::edges::Edges;
use super::equations::{Pulls, Rows};
use super::seen::Seen;
use super::state::State;
use super::uncertainty;
use crate::fit::loss::Loss;
use crate::fit::solver::Normal;
use crate::model::leaf::Lattice;
use crate::model::{Habit, Species};
use crate::traits::Sigmas;

/// Independent observations that a blade's points amount to: neighbours err together (a guess).
pub(super) const INDEPENDENT: f64 = 80.0;

/// How closely the fit looks.
pub(super) struct Level<'a> {
    pub data: &'a Data,
    pub species: &'a Species,
    pub lattice: Lattice,
    /// Standard deviation of the points about the surface, metres.
    pub sigma: f64,
    /// How to find where the edge should be; while the blade is far, points beyond its edge pull instead.
    pub edges: Option<Edges>,
    /// The node nearest to each point when the level began.
    pub nodes: Vec<usize>,
    pub base_moves: bool,
    /// What the priors on β and γ weigh.
    pub prior: f64,
}

impl Level<'_> {
    /// The uncertainty of the blade's traits, when `state` is where the fit ends.
    pub(super) fn sigmas(&self, state: &State, up: DVec3) -> Sigmas {
        let (sheet, jacobian) = state.linearised(self.species, self.lattice);
        uncertainty::sigmas(self.normal(state).h, &Rows::new(state, &sheet, &jacobian, self.base_moves), up)
    }

    pub(super) fn normal(&self, state: &State) -> Normal {
        let (sheet, jacobian) = state.linearised(self.species, self.lattice);
        let seen = Seen::of(sheet, self.data, Some(&self.nodes));
        let sheet = &seen.sheet;
        let mut pulls = Pulls::on(sheet.points.len());
        // Data to surface: off the edge the whole miss counts, above the blade only its height does.
        let share = INDEPENDENT / self.data.points.len() as f64;
        for ((p, n), height) in self.data.points.iter().zip(&seen.nodes).zip(&seen.heights) {
            if self.edges.is_none() && sheet.on_edge(*n) {
                let gap = sheet.points[*n] - *p;
                pulls.gap(*n, gap, Loss::huber(gap.length(), self.sigma).times(share));
            } else {
                pulls.height(*n, *height, Loss::huber(*height, self.sigma).times(share));
            }
        }
        // Surface to data: beside data the height above them counts already, elsewhere all of the gap does. Once the
        // blade is near, what is far from data is a hole in them and no fault of the blade's.
        let share = INDEPENDENT / sheet.areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        for (n, gap) in seen.gaps(self.data, BESIDE * self.data.spacing) {
            let miss = gap.length();
            let loss = match self.edges {
                None => Loss::huber(miss, self.sigma),
                Some(_) => Loss::bounded(miss, BESIDE * self.data.spacing, 30.0),
            };
            pulls.gap(n, gap, loss.times(share * sheet.areas[n]));
        }
        if let Some(edges) = self.edges {
            edges.pull(sheet, &seen.counts, &mut pulls);
        }
        let mut normal = pulls.linearise(state, sheet, &jacobian, self.base_moves);
        priors(&mut normal, state, self.species, self.prior);
        normal
    }
}

/// Adds the priors on β and γ, which weigh `weight`, and on s_x.
pub(super) fn priors(normal: &mut Normal, state: &State, species: &Species, weight: f64) {
    let coefficients = state.beta.iter().chain(&state.gamma);
    for (i, c) in coefficients.enumerate() {
        normal.prior(State::COEFFICIENTS + i, *c, weight);
    }
    // s_x is 1 outside grasses: a pull no data outweighs keeps the step at 0.
    let weight = if species.habit == Habit::Grass { 1.0 } else { 1e12 };
    normal.prior(State::COEFFICIENTS + state.beta.len() + state.gamma.len(), 0.0, weight);
}
