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

/// How a camera does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraHealth {
    /// Its name on the rig.
    pub id: CameraId,
    /// Where it is plugged in.
    pub device: String,
    /// What it is doing.
    pub state: CameraState,
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
