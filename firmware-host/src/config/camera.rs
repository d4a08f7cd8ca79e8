//! `[[cameras]]`: the rig's cameras.

use std::path::PathBuf;

use demeter_capture::{
    Backend, CameraSettings, Controls, ID, Manifest, Mode, Mount, Row, SCHEMA_VERSION, SessionCamera, Speed, is_id,
    longest_exposure, sampling,
};
use demeter_frame::{Calibration, CameraError, CameraId, Intrinsics, PixelFormat};
use serde::Deserialize;

use crate::error::CommandError;
use crate::files;

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
    /// Horizontal field of view, degrees: the lens's data sheet or a photo of a ruler tells. A calibration goes before it.
    #[serde(default)]
    pub hfov_deg: Option<f64>,
    /// A calibration file in place of the field of view: `demeter camera calibrate` writes one.
    #[serde(default)]
    pub calibration: Option<PathBuf>,
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
    /// A camera on a port, with everything else as it is by default; what it sees is still to be told.
    #[must_use]
    pub fn new(id: &str, device: &str, height_m: f64) -> Self {
        Self {
            id: id.into(),
            device: device.into(),
            backend: Backend::default(),
            format: jpeg(),
            width: width(),
            height: height(),
            rate: rate(),
            hfov_deg: None,
            calibration: None,
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
        let degrees = self.hfov_deg.or(self.calibration.is_some().then_some(10.0));
        if !degrees.is_some_and(|degrees| (10.0..=170.0).contains(&degrees)) {
            let found = degrees.map_or_else(|| "neither".into(), |degrees| degrees.to_string());
            return Err(("cameras.hfov_deg", "10 to 170 degrees, or a file under calibration", found));
        }
        let wrong = numbers.into_iter().find(|(.., value, range)| !range.contains(value));
        wrong.map_or(Ok(()), |(key, expected, found, _)| Err((key, expected, found.to_string())))
    }

    /// What the camera sees, by its calibration file or its field of view.
    ///
    /// # Errors
    /// [`CommandError`] naming the file that cannot be read, or is of another picture size.
    pub fn calibrated(&self) -> Result<Calibration, CommandError> {
        let (width, height) = (self.width, self.height);
        let wrong = |error: CameraError| CommandError::usage("calibration", error);
        if let Some(file) = &self.calibration {
            return files::calibration(file)?.sized(width, height).map_err(|error| wrong(error).of(file));
        }
        let hfov = self.hfov_deg.unwrap_or_default().to_radians();
        Calibration::new(Intrinsics::from_hfov(width, height, hfov), None).map_err(wrong)
    }

    /// What capture needs, for a rig that drives so fast.
    ///
    /// # Errors
    /// As [`Self::calibrated`].
    pub fn settings(&self, speed: Speed) -> Result<CameraSettings, CommandError> {
        let sampling = sampling(self.distance_m, self.calibrated()?.intrinsics().fx);
        let (longest_exposure, smear) = match speed {
            Speed::Given(speed) => ((speed != 0.0).then(|| longest_exposure(speed, sampling, self.blur_px)), None),
            Speed::Measured { .. } => (None, Some(sampling * self.blur_px)),
        };
        Ok(CameraSettings {
            id: CameraId(self.id.clone()),
            device: self.device.clone(),
            backend: self.backend,
            mode: Mode { format: self.format, width: self.width, height: self.height, rate: self.rate },
            controls: Controls { longest_exposure, gain: self.gain, white_balance: self.white_balance_k },
            mount: Some(Mount { height: self.height_m, pitch: self.tilt_deg.to_radians(), speed }),
            smear,
        })
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
///
/// # Errors
/// As [`CameraConfig::calibrated`].
pub fn manifest(
    cameras: &[CameraConfig],
    sown: Sown<'_>,
    rig_id: &str,
    session_id: &str,
) -> Result<Manifest, CommandError> {
    let camera = |camera: &CameraConfig| {
        let calibration = camera.calibrated()?;
        Ok(SessionCamera {
            id: CameraId(camera.id.clone()),
            height_above_ground_m: Some(camera.height_m),
            intrinsics: *calibration.intrinsics(),
            distortion: calibration.distortion().copied(),
            rig_from_camera: None,
        })
    };
    Ok(Manifest {
        schema_version: SCHEMA_VERSION,
        rig_id: rig_id.into(),
        session_id: session_id.into(),
        species: sown.species.into(),
        cameras_from_antenna_m: sown.arm,
        cameras: cameras.iter().map(camera).collect::<Result<_, CommandError>>()?,
        rows: vec![Row { row: "1".into(), plot: None, plant_spacing_m: sown.spacing }],
    })
}

#[cfg(test)]
mod tests {
    use demeter_capture::camera_info;
    use demeter_frame::Distortion;

    use super::*;

    #[test]
    fn a_calibration_goes_before_the_field_of_view_and_into_the_session() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let k = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 501.0, cx: 322.0, cy: 239.0 };
        let lens = Distortion::PlumbBob { coefficients: [-0.2, 0.05, 0.0, 0.0, 0.0] };
        std::fs::write(file.path(), camera_info(&Calibration::new(k, Some(lens)).unwrap(), "left")).unwrap();
        let plain = CameraConfig { hfov_deg: Some(60.0), ..CameraConfig::new("left", "usb-1", 1.0) };
        let camera = CameraConfig { calibration: Some(file.path().into()), ..plain.clone() };
        let sown = Sown { species: "soybean", spacing: None, arm: None };
        let session = manifest(std::slice::from_ref(&camera), sown, "rig", "session").unwrap();
        assert_eq!((session.cameras[0].intrinsics, session.cameras[0].distortion), (k, Some(lens)));
        // As a session's file it is the same again.
        assert_eq!(Manifest::parse(session.to_toml().unwrap().as_bytes()).unwrap(), session);
        let plain = manifest(&[plain], sown, "rig", "session").unwrap();
        assert!(!plain.to_toml().unwrap().contains("distortion"));

        let wider = CameraConfig { width: 1280, height: 720, ..camera.clone() }.calibrated().unwrap_err().message;
        let name = file.path().display().to_string();
        for part in [name.as_str(), "1280x720", "640x480"] {
            assert!(wider.contains(part), "{wider}");
        }
        std::fs::write(file.path(), "camera_matrix: 5").unwrap();
        assert!(camera.calibrated().unwrap_err().message.contains(&name));
        let gone = CameraConfig { calibration: Some("/no/such.yaml".into()), ..camera };
        assert!(gone.settings(Speed::Given(0.0)).unwrap_err().message.contains("/no/such.yaml"));
    }
}
