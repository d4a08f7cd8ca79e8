//! `[[cameras]]`: the rig's cameras.

use demeter_capture::{
    Backend, CameraSettings, Controls, ID, Manifest, Mode, Mount, Row, SCHEMA_VERSION, SessionCamera, Speed, is_id,
    longest_exposure, sampling,
};
use demeter_frame::{CameraId, Intrinsics, PixelFormat};
use serde::Deserialize;

/// One camera: which, what it gives, how it is held.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// Its name on the rig, as `left`.
    pub id: String,
    /// Where it is plugged in, as `demeter camera list` says.
    pub device: String,
    /// v4l2, or libcamera for sensors that need it.
    #[serde(default)]
    pub backend: Backend,
    /// jpeg, nv12, yuyv, rgb24 or grey.
    #[serde(default = "jpeg")]
    pub format: PixelFormat,
    /// Pixels.
    #[serde(default = "width")]
    pub width: u32,
    /// Pixels.
    #[serde(default = "height")]
    pub height: u32,
    /// Frames a second.
    #[serde(default = "rate")]
    pub rate: f64,
    /// Horizontal field of view, degrees: the lens's data sheet or a photo of a ruler tells.
    pub hfov_deg: f64,
    /// Height of the lens above the ground, metres.
    pub height_m: f64,
    /// How far the camera looks above the horizon, degrees; negative downwards.
    #[serde(default)]
    pub tilt_deg: f64,
    /// How far away the plants are, metres: the exposure limit follows from it.
    #[serde(default = "one")]
    pub distance_m: f64,
    /// How far a plant may move through the picture during an exposure, pixels.
    #[serde(default = "one")]
    pub blur_px: f64,
    /// Gain in the camera's own steps; automatic unless given.
    #[serde(default)]
    pub gain: Option<i32>,
    /// White balance, kelvin; automatic unless given.
    #[serde(default)]
    pub white_balance_k: Option<i32>,
}

fn jpeg() -> PixelFormat {
    PixelFormat::Jpeg
}

fn width() -> u32 {
    640
}

fn height() -> u32 {
    480
}

/// A plant every 0.1 m is seen in six pictures at 1 m/s and half a metre of view (a guess).
fn rate() -> f64 {
    15.0
}

/// Metres to the plants, and pixels of blur: both guesses.
fn one() -> f64 {
    1.0
}

/// A value out of bounds: the key, what is allowed, what was found.
pub type BadValue = (&'static str, &'static str, String);

impl CameraConfig {
    /// A camera on a port, with everything else as it is by default.
    #[must_use]
    pub fn new(id: &str, device: &str, hfov_deg: f64, height_m: f64) -> Self {
        Self {
            id: id.into(),
            device: device.into(),
            backend: Backend::default(),
            format: jpeg(),
            width: width(),
            height: height(),
            rate: rate(),
            hfov_deg,
            height_m,
            tilt_deg: 0.0,
            distance_m: one(),
            blur_px: one(),
            gain: None,
            white_balance_k: None,
        }
    }

    /// Checks what the types do not say.
    ///
    /// # Errors
    /// The first key that is out of bounds.
    pub fn check(&self) -> Result<(), BadValue> {
        let sides = 1..=Intrinsics::MAX_SIDE;
        let numbers = [
            ("cameras.rate", "0.1 to 1000 frames a second", self.rate, 0.1..=1000.0),
            ("cameras.hfov_deg", "10 to 170 degrees", self.hfov_deg, 10.0..=170.0),
            ("cameras.height_m", "0.01 to 100 metres", self.height_m, 0.01..=100.0),
            ("cameras.tilt_deg", "-90 to 90 degrees", self.tilt_deg, -90.0..=90.0),
            ("cameras.distance_m", "0.01 to 100 metres", self.distance_m, 0.01..=100.0),
            ("cameras.blur_px", "0.01 to 100 pixels", self.blur_px, 0.01..=100.0),
        ];
        if !is_id(&self.id) {
            return Err(("cameras.id", ID, format!("{:?}", self.id)));
        }
        if !sides.contains(&self.width) || !sides.contains(&self.height) {
            let found = format!("{} x {}", self.width, self.height);
            return Err(("cameras.width", "1 to 16384 pixels a side", found));
        }
        let wrong = numbers.into_iter().find(|(.., value, range)| !range.contains(value));
        wrong.map_or(Ok(()), |(key, expected, found, _)| Err((key, expected, found.to_string())))
    }

    /// What capture needs, for a rig that drives so fast.
    #[must_use]
    pub fn settings(&self, speed: Speed) -> CameraSettings {
        let sampling = sampling(self.distance_m, self.intrinsics().fx);
        let (longest_exposure, smear) = match speed {
            Speed::Given(speed) => ((speed != 0.0).then(|| longest_exposure(speed, sampling, self.blur_px)), None),
            Speed::Measured { .. } => (None, Some(sampling * self.blur_px)),
        };
        CameraSettings {
            id: CameraId(self.id.clone()),
            device: self.device.clone(),
            backend: self.backend,
            mode: Mode { format: self.format, width: self.width, height: self.height, rate: self.rate },
            controls: Controls { longest_exposure, gain: self.gain, white_balance: self.white_balance_k },
            mount: Some(Mount { height: self.height_m, pitch: self.tilt_deg.to_radians(), speed }),
            smear,
        }
    }

    fn intrinsics(&self) -> Intrinsics {
        Intrinsics::from_hfov(self.width, self.height, self.hfov_deg.to_radians())
    }
}

/// What the cameras drive along.
#[derive(Clone, Copy, Debug)]
pub struct Sown<'a> {
    /// A species that the program knows.
    pub species: &'a str,
    /// Distance from plant to plant, metres, where it is known.
    pub spacing: Option<f64>,
    /// Where the cameras are from the antenna, of a rig with a receiver ([`Manifest::cameras_from_antenna_m`]).
    pub arm: Option<[f64; 2]>,
}

/// The session of these cameras, before its first frame.
#[must_use]
pub fn manifest(cameras: &[CameraConfig], sown: Sown<'_>, rig_id: &str, session_id: &str) -> Manifest {
    let camera = |camera: &CameraConfig| SessionCamera {
        id: CameraId(camera.id.clone()),
        height_above_ground_m: Some(camera.height_m),
        intrinsics: camera.intrinsics(),
        rig_from_camera: None,
    };
    Manifest {
        schema_version: SCHEMA_VERSION,
        rig_id: rig_id.into(),
        session_id: session_id.into(),
        species: sown.species.into(),
        cameras_from_antenna_m: sown.arm,
        cameras: cameras.iter().map(camera).collect(),
        rows: vec![Row { row: "1".into(), plot: None, plant_spacing_m: sown.spacing }],
    }
}
