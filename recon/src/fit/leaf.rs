//! One blade alone: pose, size, shape and deformation by damped Gauss-Newton on both directions of the Chamfer
//! distance, robustly and with priors on β and γ (paper eq. 7; stage 1 of spec/reconstruction.md).

use glam::{DMat3, DQuat, DVec3};

use super::centreline::{angles_along, course, length, resample};
use super::orient::turn_onto;
use super::solver::{Normal, minimise};
use super::stem::{clipped, mean, median};
use crate::axes::PrincipalAxes;
use crate::model::leaf::{ANGLES, Blade, BladeJacobian, COLUMNS, POINTS, ROWS, VEIN, gauge, node, vein_angle};
use crate::model::{Habit, Species};
use crate::nearest::{Nearest, Neighbour};

/// Slices of a blade's course.
const SLICES: usize = 14;
/// Most points of one blade that steer the fit; more only slow it down.
const MAX_POINTS: usize = 2_000;
/// Points that bring it near.
const FEW_POINTS: usize = 400;
/// Control points that look for data: every second row and third column.
const LOOKOUT: (usize, usize) = (2, 3);
/// Standard deviation of a scan about the model, as a share of the blade's length (a guess from real scans).
const NOISE: f64 = 0.01;
/// Independent observations that a blade's points amount to: neighbours err together (a guess).
const INDEPENDENT: f64 = 150.0;

/// A fitted blade in the world.
#[derive(Clone, Debug)]
pub(crate) struct LeafFit {
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
}

#[derive(Clone)]
struct State {
    rotation: DQuat,
    log_length: f64,
    log_width: f64,
    beta: Vec<f64>,
    gamma: Vec<f64>,
}

impl State {
    fn blade(&self) -> Blade {
        Blade { beta: self.beta.clone(), gamma: self.gamma.clone(), width: self.log_width.exp() }
    }
}

/// A blade's data, prepared once.
struct Data<'a> {
    base: DVec3,
    points: Vec<DVec3>,
    tree: Nearest,
    /// Mean distance to the tenth neighbour or so: what one cannot see between, metres.
    spacing: f64,
    species: &'a Species,
}

/// Fits a blade whose base is attached at `base`; `up` tells the upper side where the cloud cannot.
pub(crate) fn fit(points: &[DVec3], base: DVec3, up: DVec3, species: &Species) -> LeafFit {
    let coarse = Data::new(points, base, species, FEW_POINTS);
    let fine = Data::new(points, base, species, MAX_POINTS);
    let near = |mut state: State| {
        minimise(&mut state, 15, |s| coarse.normal(s), |s, step| coarse.apply(s, step));
        (coarse.normal(&state).cost, state)
    };
    let nearest = |best: (f64, State), next: (f64, State)| if next.0 < best.0 { next } else { best };
    let [first, second, third] = coarse.first_guesses(up).map(near);
    let mut state = nearest(nearest(first, second), third).1;
    let converged = minimise(&mut state, 12, |s| fine.normal(s), |s, step| fine.apply(s, step));
    fine.finish(state, converged)
}

impl<'a> Data<'a> {
    /// At most about `most` of the points, evenly.
    fn new(points: &[DVec3], base: DVec3, species: &'a Species, most: usize) -> Self {
        let stride = points.len().div_ceil(most).max(1);
        let points: Vec<DVec3> = points.iter().copied().step_by(stride).collect();
        let tree = Nearest::of(&points);
        let apart = |p: &DVec3| tree.k(*p, 8).last().map(Neighbour::distance);
        let spacing = median(points.iter().step_by(7).filter_map(apart).collect()).unwrap_or(0.0).max(1e-6);
        Self { base, points, tree, spacing, species }
    }

    /// Three starts, for what one cannot tell from afar. Flat: the blade spreads as its points do and follows their
    /// course. Turned by a quarter, and across the plane of the course: a strap that arches within the picture of a
    /// single view has points that spread along the arch, and blades hardly bow within themselves. Broad blades start
    /// straight instead of turned, because the course through a folded blade is not its main vein's.
    fn first_guesses(&self, up: DVec3) -> [State; 3] {
        let path = resample(&course(&self.points, self.base, SLICES), ROWS);
        let chord = path[path.len() - 1] - path[0];
        let facing_up = |across: DVec3| if across.cross(chord).dot(up) < 0.0 { -across } else { across };
        let widest = self.across(&path);
        let flat = self.guess(&path, facing_up(widest));
        let second = if self.species.habit == Habit::Grass {
            self.guess(&path, facing_up(widest.cross(chord.normalize_or_zero())))
        } else {
            State { gamma: vec![0.0; flat.gamma.len()], ..flat.clone() }
        };
        [flat, second, self.guess(&path, facing_up(PrincipalAxes::of(path.iter().copied()).axes.z_axis))]
    }

    fn guess(&self, path: &[DVec3], across: DVec3) -> State {
        let metres = self.species.ranges.blade_length.clamp(length(path));
        let along = (path[1] - path[0]).normalize_or(DVec3::Y);
        let x = across.reject_from_normalized(along).normalize_or(along.any_orthonormal_vector());
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, along, x.cross(along)));
        let vein = angles_along(path, rotation);
        let mut angles = nalgebra::DVector::zeros(ANGLES);
        for i in 1..ROWS {
            angles[vein_angle(i)] = vein[2 * (i - 1)];
            angles[vein_angle(i) + 1] = vein[2 * (i - 1) + 1];
        }
        let half_widths: Vec<f64> = self.points.iter().map(|p| (*p - nearest_of(path, *p)).length()).collect();
        let flat = self.species.leaf.flat(&[], 1.0);
        let typical = mean(flat.iter().map(|p| p.x.abs())) * metres;
        let width = self.species.ranges.blade_width.clamp(mean(half_widths.iter().copied()) / typical.max(1e-9));
        let mut state = State {
            rotation,
            log_length: metres.ln(),
            log_width: width.ln(),
            beta: vec![0.0; self.species.leaf.shape.rank()],
            gamma: clipped(self.species.leaf.deform.project(&angles)),
        };
        // The basis does not hold every bend, so the vein that is left of the course's angles is turned onto the course.
        let raw = self.species.leaf.jacobian(&state.blade()).points;
        let vein = path.iter().enumerate().map(|(i, p)| (*p - self.base, raw[node(i, VEIN)] * metres));
        state.rotation = turn_onto(vein.chain([(x * metres, DVec3::X * metres)])).unwrap_or(rotation);
        state
    }

    /// The widest direction of the points about the course.
    fn across(&self, path: &[DVec3]) -> DVec3 {
        PrincipalAxes::of(self.points.iter().map(|p| *p - nearest_of(path, *p))).axes.x_axis
    }

    fn posed(&self, state: &State, raw: &[DVec3]) -> Vec<DVec3> {
        let s = state.log_length.exp();
        raw.iter().map(|p| self.base + state.rotation * (*p * s)).collect()
    }

    fn normal(&self, state: &State) -> Normal {
        let jacobian = self.species.leaf.jacobian(&state.blade());
        let surface = self.posed(state, &jacobian.points);
        let normals = grid_normals(&surface);
        let metres = state.log_length.exp();
        let mut pulls = Pulls::new();
        let grid = Nearest::of(&surface);
        // Data to surface: off the edge the whole miss counts, above the blade only its height does.
        let weight = 1.0 / self.points.len() as f64;
        for p in &self.points {
            let Some(Neighbour { index: n, .. }) = grid.one(*p) else { continue };
            let miss = surface[n] - *p;
            pulls.add(n, miss, (!on_edge(n)).then_some(normals[n]), self.robust(miss) * weight);
        }
        // Surface to data: where there is data beside it only the height counts, else all of the gap.
        let lookout: Vec<usize> = (1..ROWS)
            .step_by(LOOKOUT.0)
            .flat_map(|i| (0..COLUMNS).step_by(LOOKOUT.1).map(move |j| node(i, j)))
            .collect();
        let weights = patch_weights(&surface, &lookout);
        for (n, weight) in lookout.iter().zip(weights) {
            let Some(found) = self.tree.one(surface[*n]) else { continue };
            let miss = surface[*n] - self.points[found.index];
            let beside = found.distance() < 2.0 * self.spacing;
            pulls.add(*n, miss, beside.then_some(normals[*n]), self.robust(miss) * weight);
        }
        let mut normal = pulls.linearise(self.base, state, &jacobian, &surface, &normals);
        let prior = (NOISE * metres) / INDEPENDENT;
        for (k, c) in state.beta.iter().chain(&state.gamma).enumerate() {
            normal.prior(4 + k, *c, prior);
        }
        let last = normal.g.len() - 1;
        if self.species.habit == Habit::Grass {
            normal.prior(last, 0.0, prior);
        } else {
            // s_x is 1 outside grasses: a pull no data outweighs keeps the step at 0.
            normal.prior(last, 0.0, 1e6);
        }
        normal
    }

    /// Weight that makes squared misses count as absolute ones above the noise (iteratively reweighted L1).
    fn robust(&self, miss: DVec3) -> f64 {
        1.0 / miss.length().max(0.5 * self.spacing)
    }

    fn apply(&self, state: &State, step: &nalgebra::DVector<f64>) -> State {
        let ranges = &self.species.ranges;
        let shapes = state.beta.len();
        let moved = |c: &[f64], from: usize| clipped(c.iter().enumerate().map(|(k, c)| c + step[from + k]).collect());
        State {
            rotation: (DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2])) * state.rotation).normalize(),
            log_length: (state.log_length + step[3]).clamp(ranges.blade_length.min.ln(), ranges.blade_length.max.ln()),
            log_width: (state.log_width + step[step.len() - 1])
                .clamp(ranges.blade_width.min.ln(), ranges.blade_width.max.ln()),
            beta: moved(&state.beta, 4),
            gamma: moved(&state.gamma, 4 + shapes),
        }
    }

    fn finish(&self, state: State, converged: bool) -> LeafFit {
        let raw = self.species.leaf.jacobian(&state.blade()).points;
        let surface = self.posed(&state, &raw);
        let grid = Nearest::of(&surface);
        let distances: Vec<f64> = self.points.iter().filter_map(|p| grid.one(*p)).map(|n| n.distance()).collect();
        let beside = |p: &DVec3| self.tree.one(*p).is_some_and(|n| n.distance() < 2.5 * self.spacing);
        let seen = surface.iter().filter(|p| beside(p)).count();
        LeafFit {
            rotation: (state.rotation * gauge(&raw).inverse()).normalize(),
            length: state.log_length.exp(),
            residual: mean(distances.iter().copied()),
            visible: seen as f64 / POINTS as f64,
            blade: state.blade(),
            converged,
        }
    }
}

/// Misses summed by grid node: all that pull one node along one direction share a gradient.
struct Pulls {
    /// Along each node's normal: sums of weight and of weighted miss.
    height: Vec<(f64, f64)>,
    /// In all directions: sums of weight and of weighted miss.
    whole: Vec<(f64, DVec3)>,
    cost: f64,
}

impl Pulls {
    fn new() -> Self {
        Self { height: vec![(0.0, 0.0); POINTS], whole: vec![(0.0, DVec3::ZERO); POINTS], cost: 0.0 }
    }

    /// Pulls grid node `n` against `miss`, along its normal or in all directions.
    fn add(&mut self, n: usize, miss: DVec3, normal: Option<DVec3>, weight: f64) {
        if let Some(normal) = normal {
            let height = miss.dot(normal);
            self.height[n].0 += weight;
            self.height[n].1 += weight * height;
            self.cost += weight * height * height;
        } else {
            self.whole[n].0 += weight;
            self.whole[n].1 += miss * weight;
            self.cost += weight * miss.length_squared();
        }
    }

    /// The normal equations by 3 of rotation, ln length, β, γ, ln width.
    fn linearise(
        &self,
        base: DVec3,
        state: &State,
        jacobian: &BladeJacobian,
        surface: &[DVec3],
        normals: &[DVec3],
    ) -> Normal {
        let k = jacobian.coefficients;
        let metres = state.log_length.exp();
        let to_chain = state.rotation.inverse();
        let mut normal = Normal::new(4 + k);
        normal.cost = self.cost;
        let mut row = vec![0.0; 4 + k];
        let mut add = |n: usize, direction: DVec3, weighted: f64, weight: f64| {
            let at = surface[n] - base;
            let turn = at.cross(direction);
            row[..4].copy_from_slice(&[turn.x, turn.y, turn.z, at.dot(direction)]);
            let local = to_chain * direction * metres;
            for (cell, d) in row[4..].iter_mut().zip(&jacobian.derivatives[n * k..(n + 1) * k]) {
                *cell = d.dot(local);
            }
            normal.add_many(weighted, &row, weight);
        };
        for (n, up) in normals.iter().enumerate() {
            let (weight, weighted) = self.height[n];
            if weight > 0.0 {
                add(n, *up, weighted, weight);
            }
            let (weight, weighted) = self.whole[n];
            if weight > 0.0 {
                DVec3::AXES.into_iter().for_each(|axis| add(n, axis, weighted.dot(axis), weight));
            }
        }
        normal
    }
}

fn on_edge(n: usize) -> bool {
    let (i, j) = (n / COLUMNS, n % COLUMNS);
    i == 0 || i == ROWS - 1 || j == 0 || j == COLUMNS - 1
}

/// Unit normals of the grid's nodes by central differences, upper side.
fn grid_normals(surface: &[DVec3]) -> Vec<DVec3> {
    (0..POINTS)
        .map(|n| {
            let (i, j) = ((n / COLUMNS).clamp(1, ROWS - 2), n % COLUMNS);
            let across = surface[node(i, (j + 1).min(COLUMNS - 1))] - surface[node(i, j.saturating_sub(1))];
            let along = surface[node(i + 1, j)] - surface[node(i - 1, j)];
            across.cross(along).normalize_or(DVec3::Z)
        })
        .collect()
}

/// Share of the blade's area that each lookout node stands for; they sum to 1.
fn patch_weights(surface: &[DVec3], lookout: &[usize]) -> Vec<f64> {
    let width = |i: usize| surface[node(i, 0)].distance(surface[node(i, COLUMNS - 1)]);
    let raw: Vec<f64> = lookout.iter().map(|n| width(n / COLUMNS)).collect();
    let total = raw.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    raw.into_iter().map(|w| w / total).collect()
}

fn nearest_of(path: &[DVec3], p: DVec3) -> DVec3 {
    path.iter().copied().min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p))).unwrap_or(p)
}
