use std::path::PathBuf;

use demeter_capture::{Backend, devices};
use demeter_frame::PixelFormat;

use crate::config::{CameraConfig, Config, PositionConfig};
use crate::error::CommandError;

/// Horizontal field of view of a camera of which nothing is told, degrees: many a webcam's (a guess).
const HFOV_DEG: f64 = 60.0;

/// Which cameras a command takes: those of the configuration, or one that is described by options.
#[derive(Debug, clap::Args)]
pub(super) struct Pick {
    /// The configuration, whose `[[cameras]]` are taken; without it /etc/demeter/demeter.toml where there is one.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Where the camera is plugged in (`demeter camera list`), in place of the configuration's cameras. Not needed when
    /// it is the only one.
    #[arg(long)]
    device: Option<String>,
    /// Name of the camera that is described by these options.
    #[arg(long, default_value = "side")]
    id: String,
    /// v4l2 or libcamera.
    #[arg(long, default_value = "v4l2", value_parser = backend)]
    backend: Backend,
    /// jpeg, nv12, yuyv, rgb24 or grey; without it the first of them that the camera has in this size.
    #[arg(long, value_parser = format)]
    format: Option<PixelFormat>,
    /// Width and height, pixels.
    #[arg(long, default_value = "640x480", value_parser = size)]
    size: (u32, u32),
    /// Frames a second.
    #[arg(long, default_value_t = 15.0)]
    rate: f64,
    /// Horizontal field of view, degrees; 60 where there is no calibration either.
    #[arg(long)]
    hfov: Option<f64>,
    /// The camera's calibration, as for `demeter photo`.
    #[arg(long, conflicts_with = "hfov")]
    calibration: Option<PathBuf>,
    /// Height of the lens above the ground, metres.
    #[arg(long, default_value_t = 1.0)]
    height: f64,
    /// How far the camera looks above the horizon, degrees; negative downwards.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    tilt: f64,
}

impl Pick {
    /// How the rig knows where it is, as the configuration says.
    ///
    /// # Errors
    /// [`CommandError`] 2 for a configuration that is refused.
    pub(super) fn position(&self) -> Result<PositionConfig, CommandError> {
        Ok(Config::load(self.config.as_deref())?.position)
    }

    /// The cameras, at least one.
    ///
    /// # Errors
    /// [`CommandError`] 2 for values that no camera has, 1 when it is not clear which camera is meant.
    pub(super) fn cameras(&self) -> Result<Vec<CameraConfig>, CommandError> {
        if self.device.is_none() {
            let configured = Config::load(self.config.as_deref())?.cameras;
            if !configured.is_empty() {
                return Ok(configured);
            }
        }
        let device = match &self.device {
            Some(device) => device.clone(),
            None => the_only_one()?,
        };
        let (width, height) = self.size;
        let camera = CameraConfig {
            backend: self.backend,
            format: self.format.unwrap_or_else(|| offered(&device, self.size)),
            width,
            height,
            rate: self.rate,
            tilt_deg: self.tilt,
            hfov_deg: self.hfov.or(self.calibration.is_none().then_some(HFOV_DEG)),
            calibration: self.calibration.clone(),
            ..CameraConfig::new(&self.id, &device, self.height)
        };
        camera.check().map_err(|(key, expected, found)| {
            let key = key.trim_start_matches("cameras.");
            CommandError::usage("usage", format!("{key}: expected {expected}, found {found}")).with(expected, &found)
        })?;
        Ok(vec![camera])
    }
}

fn the_only_one() -> Result<String, CommandError> {
    let mut paths: Vec<String> = devices().into_iter().map(|device| device.path).collect();
    match (paths.pop(), paths.is_empty()) {
        (Some(path), true) => Ok(path),
        (Some(path), false) => {
            paths.push(path);
            let paths = paths.join(", ");
            let message = format!("expected --device or [[cameras]] to tell which camera is meant, found {paths}");
            Err(CommandError::usage("camera", message))
        }
        (None, _) => Err(CommandError::usage("camera", "expected a camera, found none plugged in")),
    }
}

/// The first format that the camera has in this size; JPEG when it has none or is not there yet.
fn offered(path: &str, size: (u32, u32)) -> PixelFormat {
    let device = devices().into_iter().find(|device| device.path == path);
    let modes = device.and_then(|device| device.modes().ok()).unwrap_or_default();
    let fits = modes.into_iter().find(|mode| (mode.width, mode.height) == size);
    fits.map_or(PixelFormat::Jpeg, |mode| mode.format)
}

fn backend(text: &str) -> Result<Backend, String> {
    match text {
        "v4l2" => Ok(Backend::V4l2),
        "libcamera" => Ok(Backend::Libcamera),
        #[cfg(feature = "nokhwa")]
        "nokhwa" => Ok(Backend::Nokhwa),
        _ => Err("expected v4l2 or libcamera".into()),
    }
}

fn format(text: &str) -> Result<PixelFormat, String> {
    let known = PixelFormat::ALL.into_iter().find(|format| format.name() == text);
    known.ok_or_else(|| format!("expected one of {}", PixelFormat::ALL.map(PixelFormat::name).join(", ")))
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    sides.ok_or_else(|| "expected WIDTHxHEIGHT, as 1280x720".into())
}
