//! A blade in stage 2: its shape stands, its place, turn and size still move.

use glam::{DQuat, DVec3};

use crate::fit::leaf::data::{BESIDE, Data, NEAR};
use crate::fit::leaf::sheet::Sheet;
use crate::fit::loss::Loss;
use crate::fit::solver::Normal;
use crate::model::leaf::{Blade, COLUMNS, Lattice, ROWS};
use crate::model::{Ranges, Species};
use crate::statistics::{deviation, mean};

/// Most points of one blade that steer it.
const MAX_POINTS: usize = 300;
/// Control points that stand for the blade: every second row, every third column.
const STEPS: (usize, usize) = (2, 3);
/// Independent observations that a blade's points amount to: neighbours err together (a guess).
const INDEPENDENT: f64 = 150.0;
/// Standard deviation of the logarithm of the length that stage 1 found from the blade's edge, for which stage 2 does
/// not look (a guess).
const LENGTH_SIGMA: f64 = 0.003;

/// Where a blade is.
#[derive(Clone, Debug)]
pub(super) struct Rigid {
    /// Metres.
    pub base: DVec3,
    /// world_from_organ, gauged.
    pub rotation: DQuat,
    /// Logarithm of the flat chord in metres.
    pub log_length: f64,
}

impl Rigid {
    /// The blade after a step over turn (rotation vector in the world) and ln length; its base stays.
    pub(super) fn stepped(&self, step: &[f64], ranges: &Ranges) -> Self {
        let range = ranges.blade_length;
        Self {
            base: self.base,
            rotation: (DQuat::from_scaled_axis(DVec3::from_slice(step)) * self.rotation).normalize(),
            log_length: (self.log_length + step[3]).clamp(range.min.ln(), range.max.ln()),
        }
    }
}

/// A blade's points and its form, prepared once.
pub(super) struct RigidData {
    data: Data,
    /// Nodes in the blade's own frame and unit length.
    nodes: Vec<DVec3>,
    /// ln length that stage 1 found.
    log_length: f64,
    /// Standard deviation of the points about the blade, metres.
    sigma: f64,
}

impl RigidData {
    pub(super) fn new(points: &[DVec3], blade: &Blade, pose: &Rigid, species: &Species) -> Self {
        let grid = species.leaf.grid(blade).points;
        let rows = grid.chunks_exact(COLUMNS).step_by(STEPS.0);
        let nodes = rows.flat_map(|row| row.iter().copied().step_by(STEPS.1)).collect();
        let data = Data::thinned(points, MAX_POINTS);
        let unjudged = Self { data, nodes, log_length: pose.log_length, sigma: f64::INFINITY };
        let noise = deviation(unjudged.heights(pose));
        Self { sigma: noise.max(NEAR * pose.log_length.exp()), ..unjudged }
    }

    fn sheet(&self, pose: &Rigid) -> Sheet {
        const { assert!((ROWS - 1).is_multiple_of(STEPS.0)) };
        let metres = pose.log_length.exp();
        let points = self.nodes.iter().map(|p| pose.base + pose.rotation * (*p * metres)).collect();
        Sheet::new(points, Lattice::every(STEPS.0, STEPS.1))
    }

    fn heights(&self, pose: &Rigid) -> Vec<f64> {
        let sheet = self.sheet(pose);
        let height = |p: &DVec3| sheet.height_above(sheet.nearest(*p, None), *p).abs();
        self.data.points.iter().map(height).collect()
    }

    /// Mean distance of the points from the surface, metres; `None` without points.
    pub(super) fn residual(&self, pose: &Rigid) -> Option<f64> {
        let sheet = self.sheet(pose);
        mean(self.data.points.iter().map(|p| {
            let n = sheet.nearest(*p, None);
            if sheet.on_edge(n) { sheet.points[n].distance(*p) } else { sheet.height_above(n, *p).abs() }
        }))
    }

    /// The normal equations over base (3), turn (3) and ln length.
    pub(super) fn normal(&self, pose: &Rigid) -> Normal {
        let sheet = self.sheet(pose);
        let mut normal = Normal::new(7);
        let mut pull = |n: usize, direction: DVec3, miss: f64, loss: Loss| {
            let from_base = sheet.points[n] - pose.base;
            let turn = from_base.cross(direction);
            let place = [direction.x, direction.y, direction.z];
            let row = [place, [turn.x, turn.y, turn.z]].concat();
            let row: [f64; 7] = std::array::from_fn(|k| row.get(k).copied().unwrap_or(from_base.dot(direction)));
            normal.cost += loss.cost;
            normal.add_many(loss.weight * miss, &row, loss.weight);
        };
        let gap = |n: usize, p: DVec3| {
            let gap = sheet.points[n] - p;
            (gap.normalize_or_zero(), gap.length())
        };
        // Data to surface: off the edge the whole miss counts, above the blade only its height does.
        let share = INDEPENDENT / self.data.points.len().max(1) as f64;
        for p in &self.data.points {
            let n = sheet.nearest(*p, None);
            let (direction, miss) =
                if sheet.on_edge(n) { gap(n, *p) } else { (sheet.normals[n], sheet.height_above(n, *p)) };
            pull(n, direction, miss, Loss::huber(miss, self.sigma).times(share));
        }
        // Surface to data: where no data are beside it.
        let share = INDEPENDENT / sheet.areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        for (n, at) in sheet.points.iter().enumerate() {
            let Some(found) = self.data.tree.one(*at) else { continue };
            if found.distance() > BESIDE * self.data.spacing {
                let (direction, miss) = gap(n, self.data.points[found.index]);
                pull(n, direction, miss, Loss::huber(miss, self.sigma).times(share * sheet.areas[n]));
            }
        }
        normal.prior(6, pose.log_length - self.log_length, LENGTH_SIGMA.powi(-2));
        normal
    }
}
