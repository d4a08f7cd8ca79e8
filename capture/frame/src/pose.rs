use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid motion `a_from_b`: `x_in_a = rotation * x_in_b + translation`.
///
/// Stored as quaternion `[x, y, z, w]` (unit, w >= 0) and translation in metres. Variables are named for the
/// frames they connect (`world_from_camera`), so that a chain reads left to right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Rotation, serialised `[x, y, z, w]`.
    #[serde(rename = "q")]
    pub rotation: DQuat,
    /// Translation in metres.
    #[serde(rename = "t")]
    pub translation: DVec3,
}

impl Pose {
    /// The motion that moves nothing.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// A motion from its parts; the rotation is normalised and brought to w >= 0.
    #[must_use]
    pub fn new(rotation: DQuat, translation: DVec3) -> Self {
        let rotation = rotation.normalize();
        Self { rotation: if rotation.w < 0.0 { -rotation } else { rotation }, translation }
    }

    /// Maps a point.
    #[must_use]
    pub fn point(&self, x: DVec3) -> DVec3 {
        self.rotation * x + self.translation
    }

    /// `a_from_c = a_from_b.then(b_from_c)`.
    #[must_use]
    pub fn then(&self, b_from_c: &Self) -> Self {
        Self::new(self.rotation * b_from_c.rotation, self.point(b_from_c.translation))
    }

    /// `b_from_a`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self::new(rotation, -(rotation * self.translation))
    }

    /// A camera at `eye` looking at `target` with `up` upwards in the picture: `world_from_camera`.
    #[must_use]
    pub fn looking_at(eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let z = (target - eye).normalize_or(DVec3::Y);
        let x = z.cross(up).normalize_or(z.any_orthonormal_vector());
        let axes = glam::DMat3::from_cols(x, z.cross(x), z);
        Self::new(DQuat::from_mat3(&axes), eye)
    }

    /// True when every number is finite and the rotation is a unit quaternion within 1e-6.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.translation.is_finite() && (self.rotation.length_squared() - 1.0).abs() < 2e-6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_undoes_and_looking_at_puts_the_target_ahead() {
        let world_from_camera = Pose::looking_at(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, DVec3::Z);
        let target = world_from_camera.inverse().point(DVec3::ZERO);
        assert!((target - DVec3::new(0.0, 0.0, 14f64.sqrt())).length() < 1e-12);
        let up = world_from_camera.inverse().rotation * DVec3::Z;
        assert!(up.y < 0.0, "the picture's y axis points down, found {up}");
        let same = world_from_camera.then(&world_from_camera.inverse());
        assert!(same.translation.length() < 1e-12 && same.rotation.w > 1.0 - 1e-12);
    }
}
