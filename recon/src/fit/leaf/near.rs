//! From several starts to one blade near the data, with few points and nodes.

use std::cell::Cell;

use super::COARSE;
use super::data::Data;
use super::level::Level;
use super::seen::Seen;
use super::state::State;
use crate::fit::solver::minimise;
use crate::model::Species;

/// How many starts go on, for how many steps, and the standard deviation of the points about the model meanwhile, as a
/// share of the blade's length (a guess): the nearer, the more a misfit tells.
const HEATS: [(usize, usize, f64); 2] = [(usize::MAX, 2, 0.01), (1, 3, 0.005)];

/// The nearest of the starts, brought nearer. Their base stays: from afar it would slide along the blade's outline, and
/// hardly ever back.
pub(super) fn near(starts: impl Into<Vec<State>>, few: &Data, species: &Species) -> State {
    let mut starts = starts.into();
    // One length for all starts, or their costs could not be compared.
    let length = starts[0].metres();
    for (most, steps, far) in HEATS {
        starts.truncate(most);
        let mut ranked: Vec<(f64, State)> = Vec::with_capacity(starts.len());
        for mut state in starts {
            let nodes = Seen::of(state.sheet(species, COARSE), few, None).nodes;
            let sigma = far * length;
            let level =
                Level { data: few, species, lattice: COARSE, sigma, edges: None, nodes, base_moves: false, prior: 1.0 };
            // The state that is kept is the cheapest that was tried.
            let least = Cell::new(f64::INFINITY);
            let normal = |state: &State| {
                let normal = level.normal(state);
                least.set(least.get().min(normal.cost));
                normal
            };
            minimise(&mut state, steps, normal, |state, step| state.stepped(step, species));
            ranked.push((least.get(), state));
        }
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts = ranked.into_iter().map(|(_, state)| state).collect();
    }
    starts.swap_remove(0)
}
