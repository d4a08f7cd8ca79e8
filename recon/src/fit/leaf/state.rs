//! The numbers that the fit of a blade moves.

use glam::{DQuat, DVec3};
use nalgebra::DVector;

use super::sheet::Sheet;
use crate::fit::stem::clipped;
use crate::model::Species;
use crate::model::leaf::{Blade, BladeJacobian, Lattice};

/// A blade on its way to the data; angles as of the raw chain, before the gauge.
#[derive(Clone, Debug)]
pub(in crate::fit) struct State {
    /// Where the main vein starts, metres.
    pub base: DVec3,
    /// world_from_chain.
    pub rotation: DQuat,
    /// Logarithm of the flat chord in metres.
    pub log_length: f64,
    /// Logarithm of s_x.
    pub log_width: f64,
    pub beta: Vec<f64>,
    pub gamma: Vec<f64>,
}

impl State {
    /// Index of the first of β, γ, ln s_x in a step: rotation (3) and ln length stand before them.
    pub(in crate::fit) const COEFFICIENTS: usize = 4;

    pub(in crate::fit) fn blade(&self) -> Blade {
        Blade { beta: self.beta.clone(), gamma: self.gamma.clone(), width: self.log_width.exp() }
    }

    /// Length of the flat chord, metres.
    pub(in crate::fit) fn metres(&self) -> f64 {
        self.log_length.exp()
    }

    /// A point of the raw chain in the world.
    pub(in crate::fit) fn place(&self, raw: DVec3) -> DVec3 {
        self.base + self.rotation * (raw * self.metres())
    }

    /// The surface at a lattice's nodes.
    pub(super) fn sheet(&self, species: &Species, lattice: Lattice) -> Sheet {
        let raw = species.leaf.points(&self.blade(), lattice);
        Sheet::new(raw.into_iter().map(|p| self.place(p)).collect(), lattice)
    }

    /// The surface at a lattice's nodes with the raw chain's derivatives there.
    pub(super) fn linearised(&self, species: &Species, lattice: Lattice) -> (Sheet, BladeJacobian) {
        let jacobian = species.leaf.jacobian_on(&self.blade(), lattice);
        (Sheet::new(jacobian.points.iter().map(|p| self.place(*p)).collect(), lattice), jacobian)
    }

    /// The state after a step (rotation vector in the world, ln length, β, γ, ln s_x and, where the base may move, its
    /// shift), kept inside the model.
    pub(in crate::fit) fn stepped(&self, step: &DVector<f64>, species: &Species) -> Self {
        let ranges = &species.ranges;
        let vector = |at: usize| DVec3::new(step[at], step[at + 1], step[at + 2]);
        let moved = |c: &[f64], from: usize| clipped(c.iter().enumerate().map(|(k, c)| c + step[from + k]).collect());
        let bends = Self::COEFFICIENTS + self.beta.len();
        let width = bends + self.gamma.len();
        Self {
            base: if step.len() > width + 1 { self.base + vector(width + 1) } else { self.base },
            rotation: (DQuat::from_scaled_axis(vector(0)) * self.rotation).normalize(),
            log_length: (self.log_length + step[3]).clamp(ranges.blade_length.min.ln(), ranges.blade_length.max.ln()),
            log_width: (self.log_width + step[width]).clamp(ranges.blade_width.min.ln(), ranges.blade_width.max.ln()),
            beta: moved(&self.beta, Self::COEFFICIENTS),
            gamma: moved(&self.gamma, bends),
        }
    }
}
