//! Chains of rigid bones: the one piece of mathematics that leaves and stems share (paper eq. 5).

use glam::{DMat3, DVec3};

/// A frame at the end of a bone with its derivatives by two kinds of coefficients: those that change angles (swings)
/// and those that change bones (slides).
///
/// Rotation derivatives are angular velocities ω_k in the organ's frame (dF = [ω_k]× F), translation derivatives are
/// velocities: propagating both along the chain gives every control point's Jacobian in one pass. The numbers of one
/// axis lie side by side, so that the compiler turns each pass over the coefficients into vector instructions.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    /// Its columns are the axes of the bone's frame in the organ's.
    pub frame: DMat3,
    pub point: DVec3,
    swings: usize,
    /// Angular velocity by each swing, `[x, y, z][swings]`.
    spin: Vec<f64>,
    /// Velocity by each swing, then by each slide, `[x, y, z][swings + slides]`.
    velocity: Vec<f64>,
}

/// How a bone and the turn before it change: derivatives by each coefficient.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Change<'a> {
    /// Of the bone's x and y, by each slide.
    pub bone: [&'a [f64]; 2],
    /// Of the turn's two angles, by each swing.
    pub angles: [&'a [f64]; 2],
}

impl Joint {
    pub(super) fn at_origin(swings: usize, slides: usize) -> Self {
        let (spin, velocity) = (vec![0.0; 3 * swings], vec![0.0; 3 * (swings + slides)]);
        Self { frame: DMat3::IDENTITY, point: DVec3::ZERO, swings, spin, velocity }
    }

    /// Velocities along one axis (0, 1, 2): by each swing and by each slide.
    pub(super) fn velocity(&self, axis: usize) -> (&[f64], &[f64]) {
        let k = self.velocity.len() / 3;
        self.velocity[axis * k..(axis + 1) * k].split_at(self.swings)
    }

    /// Turns by `angles` about two `axes` of the current frame (as one rotation vector) and walks along `bone` (rest
    /// direction and length, in the plane z = 0). With no coefficients this is plain kinematics.
    pub(super) fn advance(&mut self, axes: [DVec3; 2], angles: [f64; 2], bone: DVec3, change: Change<'_>) {
        let before = self.frame;
        let w = axes[0] * angles[0] + axes[1] * angles[1];
        let turn = Turn::by(w);
        self.frame = before * turn.matrix();
        let step = self.frame * bone;
        self.point += step;
        if self.velocity.is_empty() {
            return;
        }
        let k = self.velocity.len() / 3;
        let turns = axes.map(|axis| before * turn.left_jacobian(axis));
        let bones = [self.frame.x_axis, self.frame.y_axis];
        let (sx, rest) = self.spin.split_at_mut(self.swings);
        let (sy, sz) = rest.split_at_mut(self.swings);
        for (axis, spin) in [&mut *sx, &mut *sy, &mut *sz].into_iter().enumerate() {
            add(spin, change.angles, turns.map(|turn| turn[axis]));
        }
        let (vx, rest) = self.velocity.split_at_mut(k);
        let (vy, vz) = rest.split_at_mut(k);
        cross(&mut vx[..self.swings], (sy, step.z), (sz, step.y));
        cross(&mut vy[..self.swings], (sz, step.x), (sx, step.z));
        cross(&mut vz[..self.swings], (sx, step.y), (sy, step.x));
        for (axis, velocity) in [vx, vy, vz].into_iter().enumerate() {
            add(&mut velocity[self.swings..], change.bone, bones.map(|bone| bone[axis]));
        }
    }
}

/// `to += a[0] f[0] + a[1] f[1]`.
fn add(to: &mut [f64], a: [&[f64]; 2], f: [f64; 2]) {
    // Slices cut to one length and indexed: zipped iterators keep the compiler from vector instructions when its
    // debug assertions are on, as they are in the profile that tests and daily work share.
    let n = to.len();
    let (first, second) = (&a[0][..n], &a[1][..n]);
    for i in 0..n {
        to[i] += first[i] * f[0] + second[i] * f[1];
    }
}

/// One axis of `to += spin × step`: `to += a.0 a.1 - b.0 b.1`.
fn cross(to: &mut [f64], a: (&[f64], f64), b: (&[f64], f64)) {
    add(to, [a.0, b.0], [a.1, -b.1]);
}

/// A rotation vector with what its rotation and derivative are made of.
struct Turn {
    w: DVec3,
    /// sin t / t, (1 - cos t) / t² and (t - sin t) / t³ at its length t.
    factors: [f64; 3],
}

impl Turn {
    fn by(w: DVec3) -> Self {
        let t2 = w.length_squared();
        // Joints of leaves turn little, and the series is cheaper than sine and cosine: up to half a radian its first
        // term left out, t¹⁶/17! and less, is below rounding.
        let factors = if t2 < 0.25 {
            [0.0, 1.0, 2.0].map(|order| {
                let mut sum = 1.0;
                let mut n = 15.0 + order;
                while n > order + 2.0 {
                    sum = 1.0 - sum * t2 / (n * (n - 1.0));
                    n -= 2.0;
                }
                if order == 2.0 {
                    sum / 6.0
                } else if order == 1.0 {
                    sum / 2.0
                } else {
                    sum
                }
            })
        } else {
            let t = t2.sqrt();
            let (sin, cos) = t.sin_cos();
            [sin / t, (1.0 - cos) / t2, (t - sin) / (t2 * t)]
        };
        Self { w, factors }
    }

    /// Exp(w), by Rodrigues' formula.
    fn matrix(&self) -> DMat3 {
        let ([x, y, z], [s, c, _]) = (self.w.to_array(), self.factors);
        let (xx, yy, zz) = (c * x * x, c * y * y, c * z * z);
        let (xy, xz, yz) = (c * x * y, c * x * z, c * y * z);
        DMat3::from_cols(
            DVec3::new(1.0 - yy - zz, xy + s * z, xz - s * y),
            DVec3::new(xy - s * z, 1.0 - xx - zz, yz + s * x),
            DVec3::new(xz + s * y, yz - s * x, 1.0 - xx - yy),
        )
    }

    /// The left Jacobian J of SO(3) times `v`: Exp(w + dw) = Exp(J dw) Exp(w) to first order.
    fn left_jacobian(&self, v: DVec3) -> DVec3 {
        let once = self.w.cross(v);
        v + once * self.factors[1] + self.w.cross(once) * self.factors[2]
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn turns_are_those_of_quaternions_on_both_sides_of_the_series_end() {
        for size in [0.0, 1e-9, 0.01, 0.3, 0.4999, 0.5001, 1.0, 3.0] {
            let w = DVec3::new(0.48, -0.6, 0.64) * size;
            let turn = Turn::by(w);
            let expected = DMat3::from_quat(DQuat::from_scaled_axis(w));
            assert!(turn.matrix().abs_diff_eq(expected, 1e-15), "{size}");
            let step = DVec3::new(1e-6, 2e-6, -1e-6);
            let after = Turn::by(w + step).matrix() * turn.matrix().transpose();
            let before = Turn::by(w - step).matrix() * turn.matrix().transpose();
            let twist = (after - before) * 0.25;
            let finite = DVec3::new(
                twist.y_axis.z - twist.z_axis.y,
                twist.z_axis.x - twist.x_axis.z,
                twist.x_axis.y - twist.y_axis.x,
            );
            assert!(finite.distance(turn.left_jacobian(step)) < 1e-12, "{size}");
        }
    }
}
