//! Pictures whose camera is known to the last digit.

use std::path::Path;

use demeter_frame::Tilt;
use demeter_models::CameraGuess;
use glam::{DMat3, DVec3};
use serde::Deserialize;

use super::{Goal, Ours, Row};
use crate::commands::eval::clouds::some;
use crate::commands::eval::{files_of, progress};
use crate::error::CommandError;
use crate::files;

/// Issue 4: the field of view within 10 %, tilt within 5 degrees.
const GOALS: (f64, f64) = (0.10, 5.0);

/// Errors of the camera over the pictures of a set.
pub(super) struct Cameras {
    field: Row,
    tilt: Row,
}

impl Cameras {
    pub(super) fn new(set: &str) -> Self {
        let row = |figure, goal| Row {
            set: set.into(),
            figure,
            ours: Vec::new(),
            ramp: Vec::new(),
            goal: Goal::AtMost(goal),
        };
        Self { field: row("field of view, relative", GOALS.0), tilt: row("tilt, degrees", GOALS.1) }
    }

    pub(super) fn add(&mut self, found: &CameraGuess, hfov: f64, tilt: Tilt) {
        self.field.ours.push((found.hfov / hfov - 1.0).abs());
        self.tilt.ours.push(found.tilt.up().angle_between(tilt.up()).to_degrees());
    }

    pub(super) fn rows(self) -> [Row; 2] {
        [self.field, self.tilt]
    }
}

/// What the scan says of a picture.
#[derive(Deserialize)]
struct Metadata {
    camera: Camera,
}

#[derive(Deserialize)]
struct Camera {
    camera_model: CameraModel,
    /// Rows of the rotation that takes the world, z up, into the camera's frame.
    rotmat: [[f64; 3]; 3],
}

#[derive(Deserialize)]
struct CameraModel {
    width: f64,
    /// fx, fy, cx, cy, and the lens' distortion.
    params: Vec<f64>,
}

/// Field of view and tilt of every `*_rgb` picture of a scan.
pub(super) fn judge(network: &mut Ours, folder: &Path, every: usize) -> Result<Vec<Row>, CommandError> {
    let is_photo = |path: &std::path::PathBuf| path.to_string_lossy().ends_with("_rgb.json");
    let paths = files_of(&folder.join("metadata/images"), "json")?.into_iter().filter(is_photo).collect();
    let paths = some(paths, every);
    let bar = progress(paths.len());
    let mut cameras = Cameras::new("scan");
    for path in paths {
        bar.inc(1);
        let bad = |message: String| CommandError::usage("data", message).of(&path);
        let Metadata { camera } = serde_json::from_slice(&files::read(&path)?).map_err(|e| bad(e.to_string()))?;
        let fx = *camera.camera_model.params.first().ok_or_else(|| bad("a camera without focal length".into()))?;
        let picture = path.with_extension("png").file_name().map(|name| folder.join("images").join(name));
        let picture = files::photo(&picture.unwrap_or_default())?;
        let maps = network.run(&picture)?;
        // Rows of the matrix are its transpose's columns.
        let up = DMat3::from_cols_array_2d(&camera.rotmat).transpose() * DVec3::Z;
        cameras.add(&maps.camera, 2.0 * (0.5 * camera.camera_model.width / fx).atan(), Tilt::of_up(up));
    }
    Ok(cameras.rows().into())
}
