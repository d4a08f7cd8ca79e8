//! multiview/maize_silhouettes: a plant fitted to one side view, judged by the others.

use std::path::Path;

use demeter_capture::decode_photo;
use demeter_frame::{Intrinsics, Pose};
use demeter_recon::model::Species;
use demeter_recon::view::patches;
use glam::{DQuat, DVec3};
use image::GrayImage;
use serde::Deserialize;

use super::outline::{iou, rendered, tinted};
use super::{Figure, Run};
use crate::error::CommandError;
use crate::files;
use crate::picture::Crop;
use crate::portrait::{Portrait, SILHOUETTE_SIDE};

pub(super) const NAME: &str = "maize_silhouettes";
const FOLDER: &str = "multiview/maize_silhouettes/plant_1";

/// `calibration_cameras.json`, millimetres and radians: the turntable's axis is z through the origin.
#[derive(Deserialize)]
struct Calibration {
    angle_factor: f64,
    clockwise: bool,
    cameras_parameters: Cameras,
}

#[derive(Deserialize)]
struct Cameras {
    side: Camera,
}

#[derive(Deserialize)]
struct Camera {
    #[serde(rename = "_focal_length_x")]
    fx: f64,
    #[serde(rename = "_focal_length_y")]
    fy: f64,
    #[serde(rename = "_width_image")]
    width: u32,
    #[serde(rename = "_height_image")]
    height: u32,
    #[serde(rename = "_pos_x")]
    x: f64,
    #[serde(rename = "_pos_y")]
    y: f64,
    #[serde(rename = "_pos_z")]
    z: f64,
    #[serde(rename = "_rot_x")]
    about_x: f64,
    #[serde(rename = "_rot_y")]
    about_y: f64,
    #[serde(rename = "_rot_z")]
    about_z: f64,
}

impl Camera {
    /// Rotations are about the world's x, then y, then z; the principal point is the picture's middle.
    fn place(&self) -> (Intrinsics, Pose) {
        let turn = DQuat::from_rotation_z(self.about_z)
            * DQuat::from_rotation_y(self.about_y)
            * DQuat::from_rotation_x(self.about_x);
        let (cx, cy) = (f64::from(self.width) / 2.0, f64::from(self.height) / 2.0);
        let camera = Intrinsics { width: self.width, height: self.height, fx: self.fx, fy: self.fy, cx, cy };
        (camera, Pose::new(turn, DVec3::new(self.x, self.y, self.z) * 1e-3))
    }
}

/// A side view.
struct Side {
    silhouette: GrayImage,
    /// camera_from_plant.
    camera_from_plant: Pose,
}

pub(super) fn figures(run: &Run<'_>, notes: &mut Vec<String>) -> Result<Vec<Figure>, CommandError> {
    let folder = run.data.join(FOLDER);
    let species = files::species("maize")?;
    let (camera, sides) = sides(&folder)?;
    let spread = |side: &Side| bounds(&side.silhouette).map_or(0, |[x0, _, x1, _]| x1 - x0);
    let widest = (0..sides.len()).max_by_key(|&k| spread(&sides[k])).unwrap_or(0);
    let (mut own, mut others) = (Vec::new(), Vec::new());
    let (mut own_widest, mut others_widest) = (Vec::new(), Vec::new());
    for (k, side) in sides.iter().enumerate() {
        if k != widest && k % run.args.every != 0 {
            continue;
        }
        let Some(portrait) = fitted(side, &camera, &species)? else {
            notes.push(format!("{NAME}: no plant in side view {k}"));
            own.push(0.0);
            others.push(0.0);
            continue;
        };
        let mut agreements = Vec::new();
        for other in &sides {
            let camera_from_first = other.camera_from_plant.then(&side.camera_from_plant.inverse());
            let drawn = rendered(&portrait.in_camera, &species, &camera, camera_from_first)?;
            agreements.push(iou(&drawn, &other.silhouette));
            let name = format!("{k:02}-{:02}", agreements.len() - 1);
            let shown = image::DynamicImage::ImageLuma8(other.silhouette.clone()).to_rgb8();
            run.draw("silhouettes", Path::new(&name), &[&tinted(&shown, &drawn)])?;
        }
        let mine = agreements.remove(k);
        if k == widest {
            own_widest.push(mine);
            others_widest.extend(&agreements);
        }
        own.push(mine);
        others.extend(agreements);
    }
    let figure = |name, values, goal| Figure { set: NAME, name, values, goal };
    Ok(vec![
        figure("IoU in the widest view, fitted to it", own_widest, ">= 0.60"),
        figure("IoU in the 11 others, fitted to the widest", others_widest, ">= 0.35"),
        figure("IoU in the view fitted to, each view in turn", own, ""),
        figure("IoU in the 11 others, each view in turn", others, ""),
    ])
}

/// The plant of one silhouette, its depth being that of the turntable's axis.
fn fitted(side: &Side, camera: &Intrinsics, species: &Species) -> Result<Option<Portrait>, CommandError> {
    let Some(bounds) = bounds(&side.silhouette) else { return Ok(None) };
    let crop = Crop::around(&side.silhouette, camera, bounds, SILHOUETTE_SIDE);
    let depth = side.camera_from_plant.translation.z;
    Portrait::of_silhouette(&crop, depth, species, camera).map_err(|error| CommandError::failed("fit", &error))
}

fn bounds(silhouette: &GrayImage) -> Option<[u32; 4]> {
    patches(silhouette).into_iter().max_by_key(|patch| patch.pixels.len()).map(|patch| patch.bounds)
}

fn sides(folder: &Path) -> Result<(Intrinsics, Vec<Side>), CommandError> {
    let path = folder.join("calibration/calibration_cameras.json");
    let calibration: Calibration = serde_json::from_slice(&files::read(&path)?)
        .map_err(|error| CommandError::failed("calibration", &error).of(&path))?;
    let (camera, world_from_camera) = calibration.cameras_parameters.side.place();
    let sign = if calibration.clockwise { -1.0 } else { 1.0 };
    let mut sides = Vec::new();
    for degrees in (0..360).step_by(30) {
        let path = folder.join(format!("bin/side/{degrees}.png"));
        let picture =
            decode_photo(&files::read(&path)?).map_err(|error| CommandError::failed("bad_image", &error).of(&path))?;
        let silhouette = image::DynamicImage::ImageRgb8(picture).to_luma8();
        let turn = sign * f64::from(degrees).to_radians() * calibration.angle_factor;
        let world_from_plant = Pose::new(DQuat::from_rotation_z(turn), DVec3::ZERO);
        sides.push(Side { silhouette, camera_from_plant: world_from_camera.inverse().then(&world_from_plant) });
    }
    Ok((camera, sides))
}
