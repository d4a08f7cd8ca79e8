use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::{Pose, Stamp};

/// A camera's stable name on its rig (`left`, `nadir`), never a /dev number.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CameraId(pub String);

impl std::fmt::Display for CameraId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// How a frame's bytes are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PixelFormat {
    /// One JPEG image.
    Jpeg,
    /// 8-bit R, G, B, rows of `stride` bytes.
    Rgb24,
}

/// One exposure as the camera gave it: bytes are not decoded until the gate asks.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Which camera.
    pub camera: CameraId,
    /// Number of the frame in its camera's stream; gaps mean lost frames.
    pub seq: u64,
    /// When.
    pub stamp: Stamp,
    /// Layout of `bytes`.
    pub format: PixelFormat,
    /// Width the camera announced, pixels.
    pub width: u32,
    /// Height the camera announced, pixels.
    pub height: u32,
    /// Bytes a row (raw formats only, else 0).
    pub stride: u32,
    /// The camera's bytes, shared between stages.
    pub bytes: Arc<[u8]>,
    /// Where the camera stood, when the rig knows.
    pub world_from_camera: Option<Pose>,
}
