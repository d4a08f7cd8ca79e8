//! A stem in the world while it is fitted, and the rows that pulls on its axis and surface add to its normal equations.

mod data;
#[cfg(test)]
mod tests;

pub(super) use data::TubeData;
use glam::{DQuat, DVec3};

use super::loss::Loss;
use super::solver::Normal;
use super::stem::clipped;
use crate::model::stem::{BONES, StemJacobian};
use crate::model::{Range, Ranges, Species};

/// A tube on its way to the data; angles as of the raw chain, before the gauge.
#[derive(Clone, Debug)]
pub(super) struct Tube {
    /// Metres.
    pub base: DVec3,
    /// world_from_chain.
    pub rotation: DQuat,
    /// Logarithm of the path length in metres.
    pub log_length: f64,
    /// Deformation in σ.
    pub gamma: Vec<f64>,
    /// Logarithm of the radius in metres.
    pub log_radius: f64,
}

impl Tube {
    /// Columns of the pose: base (3), turn (3), ln length. Those of γ and ln radius follow.
    pub(super) const POSE: usize = 7;

    /// Path length, metres.
    pub(super) fn metres(&self) -> f64 {
        self.log_length.exp()
    }

    /// Metres.
    pub(super) fn radius(&self) -> f64 {
        self.log_radius.exp()
    }

    /// The tube after a step over turn (rotation vector in the world), ln length, γ and ln radius, kept inside the
    /// model; its base stays.
    pub(super) fn stepped(&self, step: &[f64], ranges: &Ranges) -> Self {
        let within = |range: Range, x: f64| x.clamp(range.min.ln(), range.max.ln());
        let (turn, rest) = step.split_at(3);
        let bends = self.gamma.iter().zip(&rest[1..]);
        Self {
            base: self.base,
            rotation: (DQuat::from_scaled_axis(DVec3::from_slice(turn)) * self.rotation).normalize(),
            log_length: within(ranges.stem_length, self.log_length + rest[0]),
            gamma: clipped(bends.map(|(c, step)| c + step).collect()),
            log_radius: within(ranges.stem_radius, self.log_radius + rest[rest.len() - 1]),
        }
    }
}

/// A tube's axis with its derivatives, and the normal equations that grow about it.
pub(super) struct Rows<'a> {
    tube: &'a Tube,
    jacobian: StemJacobian,
    /// Control points in the world.
    pub axis: Vec<DVec3>,
    normal: Normal,
    row: Vec<f64>,
}

impl<'a> Rows<'a> {
    pub(super) fn of(tube: &'a Tube, species: &Species) -> Self {
        let jacobian = species.stem.jacobian(&tube.gamma);
        let axis = jacobian.points.iter().map(|p| tube.base + tube.rotation * (*p * tube.metres())).collect();
        let columns = Tube::POSE + jacobian.coefficients + 1;
        Self { tube, jacobian, axis, normal: Normal::new(columns), row: vec![0.0; columns] }
    }

    /// The place at fraction `t` of a bone.
    pub(super) fn place(&self, bone: usize, t: f64) -> DVec3 {
        self.axis[bone].lerp(self.axis[bone + 1], t)
    }

    /// Unit direction of a bone.
    pub(super) fn direction(&self, bone: usize) -> DVec3 {
        (self.axis[bone + 1] - self.axis[bone]).normalize_or(self.tube.rotation * DVec3::Y)
    }

    /// Pulls the axis at fraction `t` of a bone along a unit direction against a miss that grows with the place's
    /// distance along it, and by `by_radius` metres with ln radius.
    pub(super) fn pull(&mut self, (bone, t): (usize, f64), direction: DVec3, miss: f64, by_radius: f64, loss: Loss) {
        self.gradient(bone, t, direction);
        let last = self.row.len() - 1;
        self.row[last] = by_radius;
        self.normal.cost += loss.cost;
        self.normal.add_many(loss.weight * miss, &self.row, loss.weight);
    }

    /// Derivatives of the place at fraction `t` of a bone along `direction`, by every column.
    pub(super) fn gradient(&mut self, bone: usize, t: f64, direction: DVec3) -> &[f64] {
        let from_base = self.place(bone, t) - self.tube.base;
        let turn = from_base.cross(direction);
        let pose = [direction.x, direction.y, direction.z, turn.x, turn.y, turn.z, from_base.dot(direction)];
        self.row[..Tube::POSE].copy_from_slice(&pose);
        let in_chain = self.tube.rotation.inverse() * direction * self.tube.metres();
        let k = self.jacobian.coefficients;
        let of = |point: usize| &self.jacobian.derivatives[point * k..(point + 1) * k];
        for ((cell, from), to) in self.row[Tube::POSE..].iter_mut().zip(of(bone)).zip(of(bone + 1)) {
            *cell = from.lerp(*to, t).dot(in_chain);
        }
        let last = self.row.len() - 1;
        self.row[last] = 0.0;
        &self.row
    }

    /// The normal equations with the priors: one σ of a bend counts 1, a radius e times `log_radius` as `stiffness` says.
    pub(super) fn finish(mut self, log_radius: f64, stiffness: f64) -> Normal {
        for (k, c) in self.tube.gamma.iter().enumerate() {
            self.normal.prior(Tube::POSE + k, *c, 1.0);
        }
        self.normal.prior(self.row.len() - 1, self.tube.log_radius - log_radius, stiffness);
        self.normal
    }

    /// Metres along the axis from its base to fraction `t` of a bone.
    pub(super) fn along(&self, bone: usize, t: f64) -> f64 {
        (bone as f64 + t) * self.tube.metres() / BONES as f64
    }
}
