use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::Pose;

/// Why a set of intrinsics is refused.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CameraError {
    /// A focal length, centre or size that no camera has.
    #[error("intrinsics: {key} must be {expected}, found {found}")]
    Intrinsics {
        /// The offending key.
        key: &'static str,
        /// What a camera has there.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// A calibration that was made for another picture size.
    #[error(
        "expected a calibration for pictures of {}x{} pixels, found one for {}x{}",
        expected[0], expected[1], found[0], found[1]
    )]
    Size {
        /// The pictures' width and height, pixels.
        expected: [u32; 2],
        /// The calibration's.
        found: [u32; 2],
    },
}

/// Pinhole intrinsics in pixels; the centre of the top-left pixel is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Intrinsics {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point x, pixels.
    pub cx: f64,
    /// Principal point y, pixels.
    pub cy: f64,
}

impl Intrinsics {
    /// The largest image side accepted, pixels: no rig camera comes near, a forged header does.
    pub const MAX_SIDE: u32 = 16_384;

    /// Horizontal field of view, radians: the inverse of [`Self::from_hfov`].
    #[must_use]
    pub fn hfov(&self) -> f64 {
        2.0 * (0.5 * f64::from(self.width) / self.fx).atan()
    }

    /// Square pixels and a centred principal point from the horizontal field of view (radians).
    #[must_use]
    pub fn from_hfov(width: u32, height: u32, hfov: f64) -> Self {
        let f = f64::from(width) / 2.0 / (hfov / 2.0).tan();
        Self { width, height, fx: f, fy: f, cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0 }
    }

    /// Checks sizes and signs; NaN never passes.
    ///
    /// # Errors
    /// [`CameraError::Intrinsics`] naming the first bad key.
    pub fn validated(self) -> Result<Self, CameraError> {
        let bad = |key, expected, found| Err(CameraError::Intrinsics { key, expected, found });
        for (key, side) in [("width", self.width), ("height", self.height)] {
            if side == 0 || side > Self::MAX_SIDE {
                return bad(key, "1 to 16384 pixels", f64::from(side));
            }
        }
        for (key, f) in [("fx", self.fx), ("fy", self.fy)] {
            if !(f.is_finite() && f > 1.0) {
                return bad(key, "a finite focal length above 1 pixel", f);
            }
        }
        for (key, c) in [("cx", self.cx), ("cy", self.cy)] {
            if !c.is_finite() {
                return bad(key, "a finite pixel coordinate", c);
            }
        }
        Ok(self)
    }

    /// The same camera after its image was resized to `width` x `height`.
    #[must_use]
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Self { width, height, fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy }
    }

    /// Pixel coordinates of a point in the camera frame, `None` behind the camera.
    #[must_use]
    pub fn project(&self, x_in_camera: DVec3) -> Option<DVec2> {
        (x_in_camera.z > 1e-9).then(|| {
            DVec2::new(
                self.fx * x_in_camera.x / x_in_camera.z + self.cx,
                self.fy * x_in_camera.y / x_in_camera.z + self.cy,
            )
        })
    }

    /// The point seen at pixel coordinates `at` (continuous) with depth z in metres.
    #[must_use]
    pub fn unproject(&self, at: DVec2, z: f64) -> DVec3 {
        DVec3::new((at.x - self.cx) / self.fx * z, (at.y - self.cy) / self.fy * z, z)
    }
}

/// A calibrated camera somewhere in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Its intrinsics.
    pub intrinsics: Intrinsics,
    /// Where it stands.
    pub world_from_camera: Pose,
}

/// How a camera is held, whichever way it looks: what a single picture can tell of its pose. Radians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tilt {
    /// Height of the optical axis above the horizon, -π/2..=π/2; negative when the camera looks down.
    pub pitch: f64,
    /// How far the world's up leans to the right of the picture's, -π..=π. Means nothing at a pitch of ±π/2.
    pub roll: f64,
}

impl Tilt {
    /// How a camera is held in whose frame `up` points upwards; of unit length.
    #[must_use]
    pub fn of_up(up: DVec3) -> Self {
        Self { pitch: up.z.clamp(-1.0, 1.0).asin(), roll: up.x.atan2(-up.y) }
    }

    /// Upwards in the camera's frame, of unit length: the inverse of [`Self::of_up`].
    #[must_use]
    pub fn up(&self) -> DVec3 {
        let across = self.pitch.cos();
        DVec3::new(across * self.roll.sin(), -across * self.roll.cos(), self.pitch.sin())
    }
}

impl Pinhole {
    /// How the camera is held in a world whose z axis points up.
    #[must_use]
    pub fn tilt(&self) -> Tilt {
        Tilt::of_up(self.world_from_camera.rotation.inverse() * DVec3::Z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn tilt_says_where_the_horizon_is_in_the_picture() {
        let intrinsics = Intrinsics::from_hfov(640, 480, 1.1);
        assert!((intrinsics.hfov() - 1.1).abs() < 1e-12);
        for (pitch, roll) in [(0.0, 0.0), (-0.7, 0.2), (0.4, -0.5), (-1.4, 2.0)] {
            let (sin, cos) = f64::sin_cos(pitch);
            let level = Pose::looking_at(DVec3::new(3.0, -1.0, 2.0), DVec3::new(3.0, cos - 1.0, 2.0 + sin), DVec3::Z);
            // Turning the camera counter-clockwise about its axis leans the picture's content to the right.
            let turned = level.then(&Pose::new(DQuat::from_rotation_z(-roll), DVec3::ZERO));
            let camera = Pinhole { intrinsics, world_from_camera: turned };
            let tilt = camera.tilt();
            assert!((tilt.pitch - pitch).abs() < 1e-9 && (tilt.roll - roll).abs() < 1e-9, "{tilt:?}");
            assert!((tilt.up() - turned.rotation.inverse() * DVec3::Z).length() < 1e-9);
            // Points infinitely far away at the eye's height are seen on the line that pitch and roll give.
            for azimuth in [-0.4, 0.0, 0.6] {
                let away = turned.rotation.inverse() * DVec3::new(f64::sin(azimuth), f64::cos(azimuth), 0.0);
                let Some(at) = intrinsics.project(away) else { continue };
                let (x, y) = (at.x - intrinsics.cx, at.y - intrinsics.cy);
                let above = -y * tilt.roll.cos() + x * tilt.roll.sin();
                assert!((above + intrinsics.fx * tilt.pitch.tan()).abs() < 1e-6, "{above}");
            }
        }
    }

    #[test]
    fn unproject_inverts_project_and_bad_numbers_are_named() {
        let k = Intrinsics::from_hfov(640, 480, 1.0);
        let x = DVec3::new(0.3, -0.2, 1.7);
        let at = k.project(x).expect("in front");
        assert!((k.unproject(at, x.z) - x).length() < 1e-12);
        assert!(k.project(-x).is_none());
        let error = Intrinsics { fy: f64::NAN, ..k }.validated().expect_err("NaN");
        assert!(error.to_string().contains("fy"), "{error}");
        assert!(Intrinsics { width: 0, ..k }.validated().is_err());
    }
}
