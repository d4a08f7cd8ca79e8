//! Chains of rigid bones: the one piece of mathematics that leaves and stems share (paper eq. 5).

use glam::{DQuat, DVec3};

/// A frame at the end of a bone with its derivatives by two kinds of coefficients: those that change bones and those
/// that change angles.
///
/// Rotation derivatives are angular velocities ω_k in the organ's frame (dF = [ω_k]× F), translation derivatives are
/// velocities: propagating both along the chain gives every control point's Jacobian in one pass.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub frame: DQuat,
    pub point: DVec3,
    /// Velocity by each coefficient that changes bones; those turn nothing.
    pub slide: Vec<DVec3>,
    /// Angular velocity and velocity by each coefficient that changes angles.
    pub swing: Vec<(DVec3, DVec3)>,
}

impl Joint {
    pub(super) fn at_origin(slides: usize, swings: usize) -> Self {
        Self {
            frame: DQuat::IDENTITY,
            point: DVec3::ZERO,
            slide: vec![DVec3::ZERO; slides],
            swing: vec![(DVec3::ZERO, DVec3::ZERO); swings],
        }
    }

    /// Turns by the rotation vector `w` (in the current frame) and walks along `bone` (rest direction and length).
    /// `dbone` and `dw` give the derivatives of both; with no coefficients this is plain kinematics.
    pub(super) fn advance(
        &mut self,
        w: DVec3,
        bone: DVec3,
        dbone: impl Fn(usize) -> DVec3,
        dw: impl Fn(usize) -> DVec3,
    ) {
        let before = self.frame;
        self.frame = (before * DQuat::from_scaled_axis(w)).normalize();
        let step = self.frame * bone;
        self.point += step;
        for (k, velocity) in self.slide.iter_mut().enumerate() {
            *velocity += self.frame * dbone(k);
        }
        let left = LeftJacobian::at(w);
        for (k, (spin, velocity)) in self.swing.iter_mut().enumerate() {
            let turn = dw(k);
            // Most coefficients leave most joints alone.
            if turn != DVec3::ZERO {
                *spin += before * left.times(turn);
            }
            *velocity += spin.cross(step);
        }
    }
}

/// The left Jacobian of SO(3) at a rotation vector: Exp(w + dw) = Exp(J dw) Exp(w) to first order.
struct LeftJacobian {
    w: DVec3,
    first: f64,
    second: f64,
}

impl LeftJacobian {
    fn at(w: DVec3) -> Self {
        let t2 = w.length_squared();
        // Below this angle the series is exact to f64 and the closed form divides by almost zero.
        if t2 < 1e-8 {
            Self { w, first: 0.5 - t2 / 24.0, second: 1.0 / 6.0 - t2 / 120.0 }
        } else {
            let t = t2.sqrt();
            Self { w, first: (1.0 - t.cos()) / t2, second: (t - t.sin()) / (t2 * t) }
        }
    }

    fn times(&self, v: DVec3) -> DVec3 {
        let once = self.w.cross(v);
        v + once * self.first + self.w.cross(once) * self.second
    }
}
