//! Kalibr's camchain: cam0, cam1.. each with `camera_model`, `intrinsics`, `distortion_model`, `distortion_coeffs` and
//! `resolution`. How its cameras stand to each other (`T_cn_cnm1`) is left aside: a rig has no place for it yet.

use std::collections::BTreeMap;

use demeter_frame::{Calibration, Intrinsics};
use serde::Deserialize;

use super::{CalibrationError, HALF_PIXEL, distortion, value, yaml};

#[derive(Deserialize)]
struct Camera {
    camera_model: String,
    intrinsics: Vec<f64>,
    distortion_model: String,
    #[serde(default)]
    distortion_coeffs: Vec<f64>,
    resolution: Vec<u32>,
}

/// Whether a key names a camera of a chain: cam0, cam1..
pub(super) fn is_camera(key: &str) -> bool {
    key.strip_prefix("cam").is_some_and(|number| number.parse::<u16>().is_ok())
}

pub(super) fn read(text: &str, camera: Option<&str>) -> Result<Calibration, CalibrationError> {
    let mut chain = yaml::<BTreeMap<String, Camera>>(text)?;
    let names = chain.keys().cloned().collect::<Vec<_>>().join(", ");
    let name = match camera {
        Some(name) => name.to_owned(),
        None if chain.len() == 1 => names.clone(),
        None => return Err(value("cameras", "one, or its name behind the file's as FILE#cam0", names)),
    };
    let camera = chain.remove(&name).ok_or_else(|| value(&name, "a camera of the chain", names))?;
    let key = |key: &str| format!("{name}.{key}");
    if camera.camera_model != "pinhole" {
        return Err(value(key("camera_model"), "pinhole", camera.camera_model));
    }
    let &[fx, fy, cx, cy] = camera.intrinsics.as_slice() else {
        let found = format!("{:?}", camera.intrinsics);
        return Err(value(key("intrinsics"), "four numbers: fx, fy, cx, cy", found));
    };
    let &[width, height] = camera.resolution.as_slice() else {
        return Err(value(key("resolution"), "width and height", format!("{:?}", camera.resolution)));
    };
    let lens = distortion(&key("distortion_coeffs"), &camera.distortion_model, &camera.distortion_coeffs)?;
    let (cx, cy) = (cx + HALF_PIXEL, cy + HALF_PIXEL);
    Ok(Calibration::new(Intrinsics { width, height, fx, fy, cx, cy }, lens)?)
}
