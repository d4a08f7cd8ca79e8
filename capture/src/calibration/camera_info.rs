//! ROS' camera_info, as camera_calibration writes it and as the message itself is printed, and OpenCV's FileStorage: they
//! name what they share alike. OpenCV says nothing of the model but `fisheye_model: 1`.

use demeter_frame::{Calibration, Intrinsics};
use serde::Deserialize;

use super::{CalibrationError, HALF_PIXEL, distortion, value, yaml};

#[derive(Deserialize)]
struct CameraInfo {
    #[serde(alias = "width")]
    image_width: u32,
    #[serde(alias = "height")]
    image_height: u32,
    #[serde(alias = "K", alias = "k")]
    camera_matrix: Matrix,
    #[serde(alias = "D", alias = "d")]
    distortion_coefficients: Matrix,
    #[serde(default)]
    distortion_model: Option<String>,
    #[serde(default)]
    fisheye_model: u8,
}

/// A matrix by rows, or the numbers alone as in the message.
#[derive(Deserialize)]
#[serde(untagged)]
enum Matrix {
    Sized { rows: usize, cols: usize, data: Vec<f64> },
    Bare(Vec<f64>),
}

impl Matrix {
    fn data(&self, key: &str) -> Result<&[f64], CalibrationError> {
        match self {
            Self::Sized { rows, cols, data } if rows.checked_mul(*cols) != Some(data.len()) => {
                let found = format!("{rows} x {cols} with {} numbers", data.len());
                Err(value(key, "rows times cols numbers", found))
            }
            Self::Sized { data, .. } | Self::Bare(data) => Ok(data),
        }
    }
}

pub(super) fn read(text: &str) -> Result<Calibration, CalibrationError> {
    let info = yaml::<CameraInfo>(text)?;
    let matrix = info.camera_matrix.data("camera_matrix")?;
    let &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0] = matrix else {
        let expected = "nine numbers: fx, 0, cx, 0, fy, cy, 0, 0, 1";
        return Err(value("camera_matrix", expected, format!("{matrix:?}")));
    };
    let model = match (info.distortion_model.as_deref(), info.fisheye_model) {
        (Some(model), _) => model,
        (None, 0) => "plumb_bob",
        (None, _) => "equidistant",
    };
    let key = "distortion_coefficients";
    let lens = distortion(key, model, info.distortion_coefficients.data(key)?)?;
    let (width, height) = (info.image_width, info.image_height);
    let (cx, cy) = (cx + HALF_PIXEL, cy + HALF_PIXEL);
    Ok(Calibration::new(Intrinsics { width, height, fx, fy, cx, cy }, lens)?)
}

/// The text of ROS' camera_info for a camera of that name (see [`crate::is_id`]); its projection matrix is that of the
/// undistorted picture.
#[must_use]
pub fn camera_info(calibration: &Calibration, name: &str) -> String {
    let Intrinsics { width, height, fx, fy, cx, cy } = *calibration.intrinsics();
    let straight = calibration.pinhole();
    let half = HALF_PIXEL;
    let (model, coefficients) =
        calibration.distortion().map_or(("plumb_bob", &[0.0; 5][..]), |lens| (lens.name(), lens.coefficients()));
    let matrix = |key: &str, rows: usize, data: &[f64]| {
        let cols = data.len() / rows;
        // Plain decimals: Python's reader takes 1e-7 for a word.
        let data = data.iter().map(|x| format!("{x:.9}")).collect::<Vec<_>>().join(", ");
        format!("{key}:\n  rows: {rows}\n  cols: {cols}\n  data: [{data}]\n")
    };
    let projection =
        [straight.fx, 0.0, straight.cx - half, 0.0, 0.0, straight.fy, straight.cy - half, 0.0, 0.0, 0.0, 1.0, 0.0];
    [
        format!("image_width: {width}\nimage_height: {height}\ncamera_name: {name}\n"),
        matrix("camera_matrix", 3, &[fx, 0.0, cx - half, 0.0, fy, cy - half, 0.0, 0.0, 1.0]),
        format!("distortion_model: {model}\n"),
        matrix("distortion_coefficients", 1, coefficients),
        matrix("rectification_matrix", 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix("projection_matrix", 3, &projection),
    ]
    .concat()
}
