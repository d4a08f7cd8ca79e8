//! ROS' camera_info, as camera_calibration writes it and as the message itself is printed, and OpenCV's FileStorage: they
//! name what they share alike. OpenCV says nothing of the model but `fisheye_model: 1`.

use demeter_frame::{Calibration, Intrinsics};
use serde::Deserialize;

use super::{CalibrationError, HALF_PIXEL, distortion, value, yaml};

/// As a file: matrices say their size.
#[derive(Deserialize)]
struct File {
    image_width: u32,
    image_height: u32,
    camera_matrix: Matrix,
    distortion_coefficients: Matrix,
    #[serde(default)]
    distortion_model: Option<String>,
    #[serde(default)]
    fisheye_model: u8,
}

#[derive(Deserialize)]
struct Matrix {
    rows: usize,
    cols: usize,
    data: Vec<f64>,
}

impl Matrix {
    fn data(self, key: &str) -> Result<Vec<f64>, CalibrationError> {
        let Self { rows, cols, data } = self;
        if rows.checked_mul(cols) != Some(data.len()) {
            let found = format!("{rows} x {cols} with {} numbers", data.len());
            return Err(value(key, "rows times cols numbers", found));
        }
        Ok(data)
    }
}

/// As the message is printed.
#[derive(Deserialize)]
struct Message {
    width: u32,
    height: u32,
    #[serde(alias = "K")]
    k: Vec<f64>,
    #[serde(alias = "D")]
    d: Vec<f64>,
    distortion_model: String,
}

pub(super) fn read_file(text: &str) -> Result<Calibration, CalibrationError> {
    let file = yaml::<File>(text)?;
    let (matrix, lens) = ("camera_matrix", "distortion_coefficients");
    let model = match (file.distortion_model.as_deref(), file.fisheye_model) {
        (Some(model), _) => model,
        (None, 0) => "plumb_bob",
        (None, _) => "equidistant",
    };
    let k = intrinsics(matrix, file.image_width, file.image_height, &file.camera_matrix.data(matrix)?)?;
    Ok(Calibration::new(k, distortion(lens, model, &file.distortion_coefficients.data(lens)?)?)?)
}

pub(super) fn read_message(text: &str) -> Result<Calibration, CalibrationError> {
    let message = yaml::<Message>(text)?;
    let k = intrinsics("k", message.width, message.height, &message.k)?;
    Ok(Calibration::new(k, distortion("d", &message.distortion_model, &message.d)?)?)
}

fn intrinsics(key: &str, width: u32, height: u32, matrix: &[f64]) -> Result<Intrinsics, CalibrationError> {
    let &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0] = matrix else {
        return Err(value(key, "nine numbers: fx, 0, cx, 0, fy, cy, 0, 0, 1", format!("{matrix:?}")));
    };
    Ok(Intrinsics { width, height, fx, fy, cx: cx + HALF_PIXEL, cy: cy + HALF_PIXEL })
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
