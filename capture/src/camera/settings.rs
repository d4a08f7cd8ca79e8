use demeter_frame::{CameraId, PixelFormat, Pose};
use glam::DVec3;

/// A camera of the rig and what is asked of it.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSettings {
    /// Its name on the rig.
    pub id: CameraId,
    /// Where it is plugged in: what [`devices`](crate::devices) calls its path, never a /dev number.
    pub device: String,
    /// Which driver stack brings its frames.
    pub backend: Backend,
    /// What its frames are.
    pub mode: Mode,
    /// How it exposes.
    pub controls: Controls,
    /// How it is carried, when frames are to have poses.
    pub mount: Option<Mount>,
    /// How far the rig may go during an exposure, metres, where its speed is measured: the longest exposure follows it.
    pub smear: Option<f64>,
}

/// The driver stack of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// The kernel's own interface: webcams and most modules.
    #[default]
    V4l2,
    /// Debian's program `cam`, for sensors that need a pipeline in user space.
    Libcamera,
    /// The crate nokhwa, on laptops.
    #[cfg(feature = "nokhwa")]
    Nokhwa,
}

/// What frames a camera gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Layout of the bytes.
    pub format: PixelFormat,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Frames a second.
    pub rate: f64,
}

impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} x {} at {}/s", self.format, self.width, self.height, self.rate)
    }
}

/// How a camera exposes; what is `None` is left to the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    /// The longest exposure allowed, seconds ([`longest_exposure`]).
    pub longest_exposure: Option<f64>,
    /// Gain in the camera's own steps.
    pub gain: Option<i32>,
    /// White balance, kelvin.
    pub white_balance: Option<i32>,
}

/// A camera that is driven along a row: the poses of a rig that knows its speed.
///
/// The world's x axis points along the drive from where the cameras were opened, z up from the ground, and the camera looks
/// along y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// Height of the optical centre above the ground, metres.
    pub height: f64,
    /// Height of the optical axis above the horizon, radians; negative when it looks down.
    pub pitch: f64,
    /// How fast it is driven.
    pub speed: Speed,
}

/// How fast a rig drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Speed {
    /// Metres a second, always; negative when the row passes from left to right.
    Given(f64),
    /// As the satellite receiver measures it.
    Measured {
        /// The cameras look to the right of the drive: the row passes from left to right.
        rightwards: bool,
    },
}

impl Mount {
    /// `world_from_camera` at so many metres along the world's x axis from where the cameras were opened.
    #[must_use]
    pub fn pose(&self, way: f64) -> Pose {
        let eye = DVec3::new(way, 0.0, self.height);
        let (sin, cos) = self.pitch.sin_cos();
        Pose::looking_at(eye, eye + DVec3::new(0.0, cos, sin), DVec3::Z)
    }
}

/// The longest exposure (seconds) in which a plant moves by at most `blur` pixels through the picture, when the rig
/// drives at `speed` (metres a second) and one pixel covers `sampling` metres of the plant: [`sampling`] gives that.
/// Infinite at rest.
#[must_use]
pub fn longest_exposure(speed: f64, sampling: f64, blur: f64) -> f64 {
    blur * sampling / speed.abs()
}

/// Metres that one pixel covers at `distance` (metres) before a camera of focal length `focal` (pixels).
#[must_use]
pub fn sampling(distance: f64, focal: f64) -> f64 {
    distance / focal
}

#[cfg(test)]
mod tests {
    use demeter_frame::{Intrinsics, Pinhole};

    use super::*;

    /// What the limit promises, seen through the camera itself: a point moves by as many pixels as were allowed.
    #[test]
    fn within_the_longest_exposure_a_point_moves_by_the_blur_allowed() {
        let intrinsics = Intrinsics::from_hfov(1920, 1080, 1.1);
        for (speed, distance, blur) in [(0.5, 0.9, 1.0), (2.0, 0.6, 1.5), (-1.2, 1.4, 0.5)] {
            let seconds = longest_exposure(speed, sampling(distance, intrinsics.fx), blur);
            let mount = Mount { height: 1.0, pitch: 0.0, speed: Speed::Given(speed) };
            let plant = DVec3::new(0.2, distance, 1.1);
            let seen = |t| intrinsics.project(mount.pose(speed * t).inverse().point(plant)).unwrap();
            let moved = seen(seconds).distance(seen(0.0));
            assert!((moved - blur).abs() < 1e-9, "{moved} pixels, {blur} allowed");
        }
        assert_eq!(longest_exposure(0.0, 0.001, 1.0), f64::INFINITY);
    }

    #[test]
    fn a_mount_keeps_height_and_tilt_and_drives_along_x() {
        let mount = Mount { height: 1.3, pitch: -0.4, speed: Speed::Given(0.8) };
        let camera = Pinhole { intrinsics: Intrinsics::from_hfov(64, 48, 1.0), world_from_camera: mount.pose(2.0) };
        assert!((camera.world_from_camera.translation - DVec3::new(2.0, 0.0, 1.3)).length() < 1e-12);
        assert!((camera.tilt().pitch + 0.4).abs() < 1e-12 && camera.tilt().roll.abs() < 1e-12);
    }
}
