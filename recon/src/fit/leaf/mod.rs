//! One blade alone: pose, size, shape and deformation by damped Gauss-Newton on both directions of the Chamfer
//! distance, robustly and with priors on β and γ (paper eq. 7; stage 1 of spec/reconstruction.md).

pub(super) mod crowd;
pub(super) mod data;
mod edges;
mod equations;
mod fields;
mod level;
mod seen;
pub(super) mod sheet;
pub(super) mod smeared;
mod starts;
mod state;
mod uncertainty;

use std::cell::Cell;

use glam::{DQuat, DVec3};

use super::centreline::course;
use super::solver::minimise;
use crate::model::Species;
use crate::model::leaf::{Blade, Lattice, gauge};
use crate::statistics::{deviation, mean};
use crate::traits::Sigmas;
use data::{BESIDE, Data, NEAR};
use edges::{Count, Edges};
use level::Level;
use seen::Seen;
use state::State;

/// Slices of a blade's course.
const SLICES: usize = 14;
/// Most points of one blade that steer the fit; more only slow it down.
const MAX_POINTS: usize = 2_000;
/// Points that bring it near.
const FEW_POINTS: usize = 400;
/// Nodes that bring it near, and nodes that finish it.
const COARSE: Lattice = Lattice::every(4, 3);
const FINE: Lattice = Lattice::every(2, 3);
/// With few points: how many starts go on, for how many steps, and the standard deviation of the points about the
/// model meanwhile, as a share of the blade's length (a guess): the nearer, the more a misfit tells.
const HEATS: [(usize, usize, f64); 3] = [(usize::MAX, 2, 0.01), (2, 4, 0.005), (1, 5, 0.005)];
/// Rounds with all points, each of which measures their noise anew, and their steps.
const ROUNDS: usize = 2;
const STEPS: usize = 6;

/// A fitted blade in the world.
#[derive(Clone, Debug)]
pub(crate) struct LeafFit {
    /// Where the main vein starts, metres.
    pub base: DVec3,
    /// world_from_organ rotation, gauged.
    pub rotation: DQuat,
    /// Chord of the flat blade, metres.
    pub length: f64,
    pub blade: Blade,
    /// Mean distance of the points to the surface, metres.
    pub residual: f64,
    /// Share of the surface with data beside it.
    pub visible: f64,
    pub converged: bool,
    /// How sure its traits are.
    pub sigmas: Sigmas,
    /// Standard deviation of the points about the surface, metres.
    noise: f64,
    /// Square metres.
    pub area: f64,
    /// What it holds inside its edges.
    inner: Count,
    state: State,
}

/// Fits a blade whose base is attached at `base`; `up` tells the upper side where the cloud cannot.
pub(crate) fn fit(points: &[DVec3], base: DVec3, up: DVec3, species: &Species) -> LeafFit {
    let few = Data::thinned(points, FEW_POINTS);
    let starts = starts::along(&course(&few.points, base, SLICES), &few.points, up, species);
    finish(points, &few, starts.map(|state| (0, state)).to_vec(), false, up, species)
}

/// Fits a blade that hangs on nothing known: its base is at either end of its course and may move.
pub(super) fn alone(points: &[DVec3], up: DVec3, species: &Species) -> LeafFit {
    let few = Data::thinned(points, FEW_POINTS);
    let middle = few.points.iter().copied().sum::<DVec3>() / few.points.len().max(1) as f64;
    let far = few.points.iter().max_by(|a, b| a.distance_squared(middle).total_cmp(&b.distance_squared(middle)));
    let one = course(&few.points, far.copied().unwrap_or(middle), SLICES);
    let other: Vec<DVec3> = one.iter().rev().copied().collect();
    let starts = |end, course: &[DVec3]| starts::along(course, &few.points, up, species).map(|state| (end, state));
    finish(points, &few, [starts(0, &one), starts(1, &other)].concat(), true, up, species)
}

/// Brings the starts, each with the end where its base is, near with few points, each time going on with the nearest of
/// them and with each end for as long as several go on, and finishes the last one.
fn finish(
    points: &[DVec3],
    few: &Data,
    mut starts: Vec<(usize, State)>,
    base_moves: bool,
    up: DVec3,
    species: &Species,
) -> LeafFit {
    let apply = |state: &State, step: &_| state.stepped(step, species);
    // One length for all starts, or their costs could not be compared.
    let length = starts[0].1.metres();
    for (most, steps, far) in HEATS {
        if most > 1 && starts.len() > most {
            let other = starts.iter().position(|(end, _)| *end != starts[0].0).unwrap_or(1);
            starts.swap(1, other);
        }
        starts.truncate(most);
        let mut ranked: Vec<(f64, (usize, State))> = Vec::with_capacity(starts.len());
        for (end, mut state) in starts {
            let nodes = Seen::of(state.sheet(species, COARSE), few, None).nodes;
            let level =
                Level { data: few, species, lattice: COARSE, sigma: far * length, edges: None, nodes, base_moves };
            // The state that is kept is the cheapest that was tried.
            let least = Cell::new(f64::INFINITY);
            let normal = |state: &State| {
                let normal = level.normal(state);
                least.set(least.get().min(normal.cost));
                normal
            };
            minimise(&mut state, steps, normal, apply);
            ranked.push((least.get(), (end, state)));
        }
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts = ranked.into_iter().map(|(_, start)| start).collect();
    }
    let (_, mut state) = starts.swap_remove(0);
    let data = Data::thinned(points, MAX_POINTS);
    let mut seen = Seen::of(state.sheet(species, FINE), &data, None);
    let (mut converged, mut sigmas, mut noise, mut inner) = (false, Sigmas::new(), 0.0, Count::default());
    for round in 1..=ROUNDS {
        noise = deviation(seen.heights.iter().copied());
        let sigma = noise.max(NEAR * state.metres());
        let edges = Some(Edges { noise, length: state.metres(), base: base_moves });
        let level = Level { data: &data, species, lattice: FINE, sigma, edges, nodes: seen.nodes, base_moves };
        converged = minimise(&mut state, STEPS, |state| level.normal(state), apply);
        seen = Seen::of(state.sheet(species, FINE), &data, Some(&level.nodes));
        if round == ROUNDS {
            sigmas = level.sigmas(&state, up);
            inner = level.edges.map_or(inner, |edges| edges.inner(&seen.sheet, &seen.counts));
        }
    }
    LeafFit { converged, sigmas, noise, inner, ..finished(state, &seen, &data, species) }
}

/// A fit that ended at `state`, but for what the way there told.
fn finished(state: State, seen: &Seen, data: &Data, species: &Species) -> LeafFit {
    let areas = &seen.sheet.areas;
    let area = areas.iter().sum();
    let hidden: f64 = seen.gaps(data, BESIDE * data.spacing).map(|(n, _)| areas[n]).sum();
    let raw = species.leaf.points(&state.blade(), Lattice::WHOLE);
    LeafFit {
        base: state.base,
        rotation: (state.rotation * gauge(&raw).inverse()).normalize(),
        length: state.metres(),
        residual: mean(seen.distances(data)).unwrap_or(0.0),
        visible: 1.0 - hidden / f64::max(area, f64::MIN_POSITIVE),
        blade: state.blade(),
        converged: false,
        sigmas: Sigmas::new(),
        noise: 0.0,
        area,
        inner: Count::default(),
        state,
    }
}
