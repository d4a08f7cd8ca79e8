//! The normal equations of a blade from pulls on the nodes of its sheet.

use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};

use super::sheet::Sheet;
use super::state::State;
use crate::fit::loss::Loss;
use crate::fit::solver::Normal;
use crate::model::leaf::BladeJacobian;

/// Misses summed by node: all that pull one node along one direction share a gradient.
pub(super) struct Pulls {
    /// Along each node's normal: sums of weight and of weighted miss.
    heights: Vec<(f64, f64)>,
    /// In all directions: sums of weight and of weighted miss.
    gaps: Vec<(f64, DVec3)>,
    /// Along directions of their own: node, direction, weight, weighted miss.
    others: Vec<(usize, DVec3, f64, f64)>,
    cost: f64,
}

impl Pulls {
    pub(super) fn on(nodes: usize) -> Self {
        Self { heights: vec![(0.0, 0.0); nodes], gaps: vec![(0.0, DVec3::ZERO); nodes], others: Vec::new(), cost: 0.0 }
    }

    /// Pulls node `n` along its normal against a height.
    pub(super) fn height(&mut self, n: usize, height: f64, loss: Loss) {
        self.heights[n].0 += loss.weight;
        self.heights[n].1 += loss.weight * height;
        self.cost += loss.cost;
    }

    /// Pulls node `n` against a gap.
    pub(super) fn gap(&mut self, n: usize, gap: DVec3, loss: Loss) {
        self.gaps[n].0 += loss.weight;
        self.gaps[n].1 += gap * loss.weight;
        self.cost += loss.cost;
    }

    /// Pulls node `n` along a direction against a miss.
    pub(super) fn along(&mut self, n: usize, direction: DVec3, miss: f64, loss: Loss) {
        self.others.push((n, direction, loss.weight, loss.weight * miss));
        self.cost += loss.cost;
    }

    /// The normal equations by rotation (3), ln length, β, γ, ln s_x and, where the base may move, its shift (3).
    pub(super) fn linearise(&self, state: &State, sheet: &Sheet, jacobian: &BladeJacobian, base_moves: bool) -> Normal {
        let mut rows = Rows::new(state, sheet, jacobian, base_moves);
        for (n, normal) in sheet.normals.iter().enumerate() {
            let (weight, weighted) = self.heights[n];
            rows.add(n, *normal, weight, weighted);
            let (weight, weighted) = self.gaps[n];
            DVec3::AXES.into_iter().for_each(|axis| rows.add(n, axis, weight, weighted.dot(axis)));
        }
        for (n, direction, weight, weighted) in &self.others {
            rows.add(*n, *direction, *weight, *weighted);
        }
        let a = DMatrix::from_vec(rows.parameters, rows.misses.len(), rows.gradients);
        Normal { g: &a * DVector::from_vec(rows.misses), h: &a * a.transpose(), cost: self.cost }
    }
}

/// The gradients of a state's surface, and weighted residuals that are multiplied in one go, which is several times
/// faster than one by one.
pub(super) struct Rows<'a> {
    state: &'a State,
    pub sheet: &'a Sheet,
    jacobian: &'a BladeJacobian,
    /// Turns a direction of the world into the chain's frame, times the chord.
    metres_from_world: DMat3,
    pub parameters: usize,
    /// `[residual][parameter]`.
    gradients: Vec<f64>,
    misses: Vec<f64>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(state: &'a State, sheet: &'a Sheet, jacobian: &'a BladeJacobian, base_moves: bool) -> Self {
        let parameters = State::COEFFICIENTS + jacobian.coefficients + if base_moves { 3 } else { 0 };
        let metres_from_world = DMat3::from_quat(state.rotation.inverse()) * state.metres();
        Self { state, sheet, jacobian, metres_from_world, parameters, gradients: Vec::new(), misses: Vec::new() }
    }

    /// Adds the gradient of node `n`'s place along `direction` by every parameter.
    pub(super) fn add_gradient(&self, n: usize, direction: DVec3, to: &mut [f64]) {
        let at = self.sheet.points[n] - self.state.base;
        let (pose, coefficients) = to.split_at_mut(State::COEFFICIENTS);
        let turn = at.cross(direction);
        for (cell, by) in pose.iter_mut().zip([turn.x, turn.y, turn.z, at.dot(direction)]) {
            *cell += by;
        }
        let local = self.metres_from_world * direction;
        let (coefficients, shift) = coefficients.split_at_mut(self.jacobian.coefficients);
        let [x, y, z] = self.jacobian.axes(n);
        for (k, cell) in coefficients.iter_mut().enumerate() {
            *cell += x[k] * local.x + y[k] * local.y + z[k] * local.z;
        }
        for (cell, by) in shift.iter_mut().zip(direction.to_array()) {
            *cell += by;
        }
    }

    /// Derivatives of every node's x, y and z in turn, a column each, by the parameters.
    pub(super) fn by_places(&self) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(self.parameters, 3 * self.sheet.points.len());
        for (column, cells) in matrix.as_mut_slice().chunks_exact_mut(self.parameters).enumerate() {
            self.add_gradient(column / 3, DVec3::AXES[column % 3], cells);
        }
        matrix
    }

    fn add(&mut self, n: usize, direction: DVec3, weight: f64, weighted: f64) {
        if weight <= 0.0 {
            return;
        }
        let root = weight.sqrt();
        let mut row = std::mem::take(&mut self.gradients);
        let start = row.len();
        row.resize(start + self.parameters, 0.0);
        self.add_gradient(n, direction * root, &mut row[start..]);
        self.gradients = row;
        self.misses.push(weighted / root);
    }
}
