use demeter_frame::CameraId;
use serde::Serialize;

/// What a camera is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraState {
    /// Its first frame is awaited.
    #[default]
    Starting,
    /// Frames come.
    Streaming,
    /// None come; it is being opened again.
    Lost,
}

/// Frames that a rate is taken over.
pub(super) const RATE_FRAMES: usize = 30;

/// How a camera does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraHealth {
    /// Its name on the rig.
    pub id: CameraId,
    /// Where it is plugged in.
    pub device: String,
    /// What it is doing.
    pub state: CameraState,
    /// Frames that come a second, over the last [`RATE_FRAMES`]; none unless they come.
    pub rate: Option<f64>,
    /// Frames that came whole.
    pub frames: u64,
    /// Frames that the driver marked as damaged.
    pub damaged: u64,
    /// Frames missing by the driver's own count.
    pub missed: u64,
    /// Frames thrown away because nobody fetched them in time.
    pub dropped: u64,
    /// Times that it came back after it was lost.
    pub reopened: u64,
    /// Seconds since its last frame.
    pub last_frame_age: Option<f64>,
    /// What was last wrong with it.
    pub last_error: Option<String>,
}

impl CameraHealth {
    /// A camera before its first frame.
    #[must_use]
    pub fn new(id: CameraId, device: &str) -> Self {
        Self {
            id,
            device: device.into(),
            state: CameraState::Starting,
            rate: None,
            frames: 0,
            damaged: 0,
            missed: 0,
            dropped: 0,
            reopened: 0,
            last_frame_age: None,
            last_error: None,
        }
    }
}
