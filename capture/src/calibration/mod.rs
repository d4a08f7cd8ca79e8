//! Calibration files (spec/appliance.md "Cameras", spec/standards.md): Kalibr's camchain, ROS' camera_info, OpenCV's
//! FileStorage, and a JSON object of [`Intrinsics`]. They are told apart by their keys.
//!
//! The others count pixels from the centre of the first one, we from its corner: half a pixel lies between them.

mod camera_info;
mod kalibr;

use std::collections::BTreeMap;

use demeter_frame::{Calibration, CameraError, Distortion, Intrinsics};
use serde::de::{DeserializeOwned, IgnoredAny};

pub use camera_info::camera_info;

/// Largest calibration file, bytes: a guess a thousand times above any.
const MAX_BYTES: usize = 1 << 20;

/// Where a pixel's centre is when its corner is at nought.
const HALF_PIXEL: f64 = 0.5;

/// Why a calibration file is refused.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// Larger than any calibration.
    #[error("expected at most {MAX_BYTES} bytes, found {found}")]
    TooLarge {
        /// Its size.
        found: usize,
    },
    /// Not text.
    #[error("expected UTF-8 text, found a byte that is not at {found}")]
    Utf8 {
        /// Offset of the first bad byte.
        found: usize,
    },
    /// Not YAML, a key missing, a value of another type; the message shows the line.
    #[error(transparent)]
    Yaml(#[from] Box<serde_saphyr::Error>),
    /// Not JSON, a key missing or unknown; the message names the line and the key.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// Keys of no format that is known.
    #[error("expected the keys of Kalibr (cam0), ROS or OpenCV (camera_matrix) or of intrinsics (fx), found {found}")]
    Format {
        /// The keys there are.
        found: String,
    },
    /// A value that is understood and makes no sense.
    #[error("{key}: expected {expected}, found {found}")]
    Value {
        /// The key, from the top of the file.
        key: String,
        /// What belongs there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// Numbers that no camera has.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

/// Reads a calibration file. `camera` names one of a chain of several, as `cam1`.
///
/// # Errors
/// [`CalibrationError`] naming the key.
pub fn parse_calibration(bytes: &[u8], camera: Option<&str>) -> Result<Calibration, CalibrationError> {
    if bytes.len() > MAX_BYTES {
        return Err(CalibrationError::TooLarge { found: bytes.len() });
    }
    let text = std::str::from_utf8(bytes).map_err(|error| CalibrationError::Utf8 { found: error.valid_up_to() })?;
    // JSON may be indented by tabs, which YAML forbids.
    if text.trim_start().starts_with('{') {
        return Ok(Calibration::new(serde_json::from_str::<Intrinsics>(text)?, None)?);
    }
    let keys: Vec<_> = yaml::<BTreeMap<String, IgnoredAny>>(text)?.into_keys().collect();
    let has = |known: &[&str]| keys.iter().any(|key| known.contains(&key.as_str()));
    if keys.iter().any(|key| kalibr::is_camera(key)) {
        kalibr::read(text, camera)
    } else if has(&["camera_matrix"]) {
        camera_info::read_file(text)
    } else if has(&["K", "k"]) {
        camera_info::read_message(text)
    } else if has(&["fx"]) {
        Ok(Calibration::new(yaml::<Intrinsics>(text)?, None)?)
    } else {
        Err(CalibrationError::Format { found: keys.join(", ") })
    }
}

fn yaml<T: DeserializeOwned>(text: &str) -> Result<T, CalibrationError> {
    serde_saphyr::from_str(text).map_err(|error| Box::new(error).into())
}

fn value(key: impl Into<String>, expected: &'static str, found: impl ToString) -> CalibrationError {
    CalibrationError::Value { key: key.into(), expected, found: found.to_string() }
}

/// The lens of a model's name and coefficients; `None` where it bends nothing.
fn distortion(key: &str, model: &str, coefficients: &[f64]) -> Result<Option<Distortion>, CalibrationError> {
    let wrong = |expected| value(key, expected, format!("{} of {model}", coefficients.len()));
    let lens = match model {
        // Kalibr leaves out k3.
        "plumb_bob" | "radtan" => match *coefficients {
            [k1, k2, p1, p2] => Distortion::PlumbBob { coefficients: [k1, k2, p1, p2, 0.0] },
            [k1, k2, p1, p2, k3] => Distortion::PlumbBob { coefficients: [k1, k2, p1, p2, k3] },
            _ => return Err(wrong("4 or 5 coefficients")),
        },
        "equidistant" | "fisheye" => {
            let four = coefficients.try_into().map_err(|_other_length| wrong("4 coefficients"))?;
            Distortion::Equidistant { coefficients: four }
        }
        "none" | "" if coefficients.is_empty() => return Ok(None),
        "none" | "" => return Err(wrong("no coefficients")),
        _ => return Err(value(key, "the model plumb_bob, radtan, equidistant or none", model)),
    };
    // A plumb bob of noughts is a pinhole; a fisheye of noughts bends.
    let bends = matches!(lens, Distortion::Equidistant { .. }) || coefficients.iter().any(|k| *k != 0.0);
    Ok(bends.then_some(lens))
}
