//! From a blade near the data to the blade that fits: all points, finer nodes, edges where the points end.

use glam::DVec3;

use super::data::{Data, NEAR};
use super::edges::{Count, Edges};
use super::level::Level;
use super::seen::Seen;
use super::state::State;
use super::{FINE, LeafFit, finished};
use crate::fit::solver::minimise;
use crate::model::Species;
use crate::statistics::deviation;

/// Steps of a round that only tells which of two blades is to be finished, and of each round that finishes it.
const TRIAL: usize = 3;
const STEPS: usize = 6;
/// Noise in blade lengths at which the species' spread weighs fully (a guess).
const NOISY: f64 = 0.03;
/// What it weighs beside clean points: it was learned from few plants, so a blade that is seen well may leave it more
/// easily, as if its σ were nearly twice as large (from scans of soybean and sugar beet leaves and from generated ones).
const LEAST_PRIOR: f64 = 0.3;

/// What a blade is finished with.
pub(super) struct Finish<'a> {
    pub data: &'a Data,
    pub species: &'a Species,
    /// Whether the base may move.
    pub base_moves: bool,
}

/// A blade after a round.
pub(super) struct Settled<'a> {
    state: State,
    seen: Seen,
    /// How the round looked; `None` before the first.
    level: Option<Level<'a>>,
    noise: f64,
    converged: bool,
}

impl<'a> Finish<'a> {
    pub(super) fn begin(&self, state: State) -> Settled<'a> {
        let seen = Seen::of(state.sheet(self.species, FINE), self.data, None);
        Settled { state, seen, level: None, noise: 0.0, converged: false }
    }

    /// A short round, after which blades can be compared by [`Settled::misfit`].
    pub(super) fn trial(&self, state: State) -> Settled<'a> {
        self.round(self.begin(state), TRIAL)
    }

    /// The rest of the fit.
    pub(super) fn fit(&self, mut settled: Settled<'a>, rounds: usize, up: DVec3) -> LeafFit {
        for _ in 0..rounds {
            settled = self.round(settled, STEPS);
        }
        let Settled { state, seen, level, noise, converged } = settled;
        let edges = level.as_ref().and_then(|level| level.edges);
        let inner = edges.map_or(Count::default(), |edges| edges.inner(&seen.sheet, &seen.counts));
        let sigmas = level.map(|level| level.sigmas(&state, up)).unwrap_or_default();
        LeafFit { converged, sigmas, noise, inner, ..finished(state, &seen, self.data, self.species) }
    }

    /// A round, which measures the points' noise anew.
    fn round(&self, settled: Settled<'a>, steps: usize) -> Settled<'a> {
        let (mut state, (data, species)) = (settled.state, (self.data, self.species));
        let noise = deviation(settled.seen.heights.iter().copied());
        let sigma = noise.max(NEAR * state.metres());
        let edges = Some(Edges { noise, length: state.metres(), base: self.base_moves });
        let (nodes, base_moves) = (settled.seen.nodes, self.base_moves);
        let prior = (noise / (NOISY * state.metres())).clamp(LEAST_PRIOR, 1.0);
        let level = Level { data, species, lattice: FINE, sigma, edges, nodes, base_moves, prior };
        let apply = |state: &State, step: &_| state.stepped(step, species);
        let converged = minimise(&mut state, steps, |state| level.normal(state), apply);
        let seen = Seen::of(state.sheet(species, FINE), data, Some(&level.nodes));
        Settled { state, seen, level: Some(level), noise, converged }
    }
}

impl Settled<'_> {
    /// Mean distance from the points to the blade and back, metres: the Chamfer distance by its nodes.
    pub(super) fn misfit(&self, data: &Data) -> f64 {
        self.seen.chamfer(data)
    }
}
