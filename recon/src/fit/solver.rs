//! Damped Gauss-Newton (Levenberg-Marquardt) on normal equations that the caller accumulates.

use nalgebra::{DMatrix, DVector};

/// A problem linearised at one state.
pub(crate) trait Equations {
    /// How far to move each parameter.
    type Step;

    /// The cost at the state.
    fn cost(&self) -> f64;

    /// The step that minimises the damped quadratic model, `None` when it has none.
    fn step(&self, damping: f64) -> Option<Self::Step>;
}

/// Normal equations of a weighted least-squares problem at one state.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    pub h: DMatrix<f64>,
    pub g: DVector<f64>,
    pub cost: f64,
}

impl Normal {
    pub(crate) fn new(parameters: usize) -> Self {
        Self { h: DMatrix::zeros(parameters, parameters), g: DVector::zeros(parameters), cost: 0.0 }
    }

    /// Adds `weight * residual²` with the residual's gradient.
    pub(crate) fn add(&mut self, residual: f64, row: &[f64], weight: f64) {
        self.cost += weight * residual * residual;
        self.add_many(weight * residual, row, weight);
    }

    /// Adds residuals that share a gradient: the sums of `weight * residual` and of `weight`. Their cost is the
    /// caller's to add. Only the upper triangle is kept up.
    pub(crate) fn add_many(&mut self, weighted: f64, row: &[f64], weight: f64) {
        for (j, rj) in row.iter().enumerate() {
            self.g[j] += weighted * rj;
            let scaled = weight * rj;
            for (cell, ri) in self.h.column_mut(j).iter_mut().zip(&row[..=j]) {
                *cell += scaled * ri;
            }
        }
    }

    /// Adds a pull of parameter `i` (now `value`) towards 0.
    pub(crate) fn prior(&mut self, i: usize, value: f64, weight: f64) {
        self.cost += weight * value * value;
        self.g[i] += weight * value;
        self.h[(i, i)] += weight;
    }

    /// The equations with the first parameters held.
    pub(super) fn without_first(self, held: usize) -> Self {
        Self { h: self.h.remove_rows(0, held).remove_columns(0, held), g: self.g.remove_rows(0, held), cost: self.cost }
    }
}

impl Equations for Normal {
    type Step = DVector<f64>;

    fn cost(&self) -> f64 {
        self.cost
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut h = self.h.clone();
        h.fill_lower_triangle_with_upper_triangle();
        for i in 0..h.nrows() {
            h[(i, i)] += damping * h[(i, i)] + 1e-12;
        }
        let step = h.cholesky()?.solve(&-&self.g);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }
}

/// Minimises from `state`; `normal` linearises (and finds correspondences anew), `apply` takes a step inside the
/// model. A step is kept only when the newly matched cost falls. True when the cost stopped falling before the
/// iterations ran out.
pub(crate) fn minimise<S: Clone, E: Equations>(
    state: &mut S,
    iterations: usize,
    normal: impl Fn(&S) -> E,
    apply: impl Fn(&S, &E::Step) -> S,
) -> bool {
    // Relative fall of the cost below which a fit has converged.
    const TOLERANCE: f64 = 1e-4;
    let mut damping = 1e-2;
    let mut at = normal(state);
    for _ in 0..iterations {
        let Some(step) = at.step(damping) else {
            damping *= 10.0;
            continue;
        };
        let candidate = apply(state, &step);
        let there = normal(&candidate);
        if there.cost().is_finite() && there.cost() < at.cost() {
            let fall = (at.cost() - there.cost()) / at.cost().max(f64::MIN_POSITIVE);
            *state = candidate;
            at = there;
            damping = (damping * 0.3).max(1e-6);
            if fall < TOLERANCE {
                return true;
            }
        } else {
            damping *= 6.0;
            if damping > 1e6 {
                return true;
            }
        }
    }
    false
}
