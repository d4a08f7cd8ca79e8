//! One blade alone: pose, size, shape and deformation by damped Gauss-Newton on both directions of the Chamfer
//! distance, robustly and with priors on β and γ (paper eq. 7; stage 1 of spec/reconstruction.md).

pub(super) mod crowd;
pub(super) mod data;
mod edges;
mod equations;
mod fields;
mod finish;
mod level;
mod near;
mod seen;
pub(super) mod sheet;
pub(super) mod smeared;
mod starts;
pub(super) mod state;
mod uncertainty;

use glam::{DQuat, DVec3};

use super::centreline::course;
use crate::model::Species;
use crate::model::leaf::{Blade, Lattice, gauge};
use crate::statistics::mean;
use crate::traits::Sigmas;
use data::{BESIDE, Data};
use edges::Count;
use finish::Finish;
use near::near;
use seen::Seen;
use state::State;

/// Slices of a blade's course.
const SLICES: usize = 14;
/// Most points of one blade that steer the fit; more only slow it down.
const MAX_POINTS: usize = 2_000;
/// The same for a lone blade, which is fitted from both ends.
const MAX_LONE_POINTS: usize = 1_200;
/// Points that bring it near.
const FEW_POINTS: usize = 400;
/// Nodes that bring it near, and nodes that finish it.
const COARSE: Lattice = Lattice::every(4, 3);
const FINE: Lattice = Lattice::every(2, 3);
/// Rounds with all points, each of which measures their noise anew.
const ROUNDS: usize = 2;

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
    let data = Data::thinned(points, MAX_POINTS);
    let finish = Finish { data: &data, species, base_moves: false };
    finish.fit(finish.begin(near(starts, &few, species)), ROUNDS, up)
}

/// Fits a blade that hangs on nothing known: its base is at either end of its course and may move. Which end it is, only
/// the outline tells, so both are tried with all points; a few points and what they cost are biased to one.
pub(super) fn alone(points: &[DVec3], up: DVec3, species: &Species) -> LeafFit {
    let few = Data::thinned(points, FEW_POINTS);
    let middle = few.points.iter().copied().sum::<DVec3>() / few.points.len().max(1) as f64;
    let far = few.points.iter().max_by(|a, b| a.distance_squared(middle).total_cmp(&b.distance_squared(middle)));
    let one = course(&few.points, far.copied().unwrap_or(middle), SLICES);
    let other: Vec<DVec3> = one.iter().rev().copied().collect();
    let data = Data::thinned(points, MAX_LONE_POINTS);
    let finish = Finish { data: &data, species, base_moves: true };
    let [one, other] =
        [one, other].map(|course| finish.trial(near(starts::along(&course, &few.points, up, species), &few, species)));
    let better = if other.misfit(&data) < one.misfit(&data) { other } else { one };
    finish.fit(better, ROUNDS - 1, up)
}

/// Starts of a blade along a known course, see [`starts::along`].
pub(super) fn starts(course: &[DVec3], points: &[DVec3], up: DVec3, species: &Species) -> [State; 3] {
    starts::along(course, points, up, species)
}

/// The fit that ended at `state`, of a blade whose points are `points`.
pub(super) fn ended(state: State, points: &[DVec3], species: &Species) -> LeafFit {
    let data = Data::thinned(points, FEW_POINTS);
    let seen = Seen::of(state.sheet(species, COARSE), &data, None);
    finished(state, &seen, &data, species)
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
