use demeter_frame::{CameraId, PixelFormat, Pose};
use serde::{Deserialize, Serialize};

use super::FrameFault;
use crate::Fix;

/// One line of index.jsonl: a frame and where its bytes are.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct IndexLine {
    pub(super) camera: CameraId,
    pub(super) seq: u64,
    /// Nanoseconds on the monotonic clock.
    pub(super) t_mono_ns: u64,
    /// RFC 3339.
    pub(super) t_wall: String,
    /// Written only where it is not the session's id.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) boot_id: Option<String>,
    /// Path in the session's folder.
    pub(super) file: String,
    /// Of the file's bytes, 64 hexadecimal digits.
    pub(super) blake3: String,
    #[serde(default = "jpeg")]
    pub(super) format: PixelFormat,
    /// Pixels; the camera's calibrated size unless given.
    #[serde(default)]
    pub(super) width: Option<u32>,
    #[serde(default)]
    pub(super) height: Option<u32>,
    /// Bytes a row, raw formats only.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) stride: u32,
}

/// One line of poses.jsonl: where a camera stood at a frame.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PoseLine {
    pub(super) camera: CameraId,
    pub(super) seq: u64,
    pub(super) world_from_camera: Pose,
}

impl IndexLine {
    /// Checks what the types do not say; the file itself is checked where it is opened.
    pub(super) fn checked(self) -> Result<Self, FrameFault> {
        if self.t_wall.parse::<jiff::Timestamp>().is_err() {
            return Err(FrameFault::Value { key: "t_wall", expected: "an RFC 3339 time", found: self.t_wall });
        }
        if blake3::Hash::from_hex(&self.blake3).is_err() {
            return Err(FrameFault::Value { key: "blake3", expected: "64 hexadecimal digits", found: self.blake3 });
        }
        Ok(self)
    }
}

impl PoseLine {
    /// A pose of finite numbers and a unit quaternion.
    pub(super) fn checked(self) -> Result<Self, FrameFault> {
        if !self.world_from_camera.is_valid() {
            let found = format!("{:?}", self.world_from_camera);
            return Err(FrameFault::Value {
                key: "world_from_camera",
                expected: "a unit quaternion q and a finite t",
                found,
            });
        }
        Ok(self)
    }
}

/// A line of gnss.jsonl: a place on Earth.
pub(super) fn checked_fix(fix: Fix) -> Result<Fix, FrameFault> {
    match fix.wrong() {
        Some(key) => Err(FrameFault::Value { key, expected: "what a place on Earth has", found: format!("{fix:?}") }),
        None => Ok(fix),
    }
}

fn jpeg() -> PixelFormat {
    PixelFormat::Jpeg
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(stride: &u32) -> bool {
    *stride == 0
}
