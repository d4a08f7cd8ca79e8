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
    /// Y, U, Y, V for each two pixels, rows of `stride` bytes.
    Yuyv,
    /// Rows of Y, `stride` bytes each, then half as many rows of U, V for each two by two pixels.
    Nv12,
    /// 8-bit grey, rows of `stride` bytes.
    Grey,
}

impl PixelFormat {
    /// Every format, in the order in which a camera's are tried: those that need the least of a USB bus first.
    pub const ALL: [Self; 5] = [Self::Jpeg, Self::Nv12, Self::Yuyv, Self::Rgb24, Self::Grey];

    /// The name in files and configurations.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Jpeg => "jpeg",
            Self::Rgb24 => "rgb24",
            Self::Yuyv => "yuyv",
            Self::Nv12 => "nv12",
            Self::Grey => "grey",
        }
    }

    /// Bytes of the pixels in one row of the first plane; 0 where rows are compressed.
    #[must_use]
    pub const fn row_bytes(self, width: u32) -> usize {
        let width = width as usize;
        match self {
            Self::Jpeg => 0,
            Self::Rgb24 => 3 * width,
            Self::Yuyv => 4 * width.div_ceil(2),
            Self::Nv12 => 2 * width.div_ceil(2),
            Self::Grey => width,
        }
    }
}

impl std::fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
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
