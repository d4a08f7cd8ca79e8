use demeter_frame::{CameraId, Frame};

use crate::{FrameError, Reason};

/// Whatever gives frames: a recording, a camera, the synthetic world. One source may serve several cameras.
pub trait Source: Send {
    /// Waits for the next frame; `None` when there will be no more.
    ///
    /// # Errors
    /// [`SourceError::Frame`] costs one frame and the next call goes on behind it; [`SourceError::Lost`] ends the source.
    fn next(&mut self) -> Result<Option<Frame>, SourceError>;

    /// How many calls of [`Source::next`] are to come before `None`, for a progress bar; `None` when unknown.
    fn len_hint(&self) -> Option<u64> {
        None
    }
}

/// Why a source gave no frame.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// One frame is lost; call again.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// One frame of a camera is lost; call again.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// No frame for a while, and nothing wrong: call again, or stop waiting.
    #[error("no camera gave a frame for a while")]
    Quiet,
    /// Nothing more will come from this source.
    #[error("the source ended while reading {what}")]
    Lost {
        /// What was being read.
        what: String,
        /// What the system said.
        source: std::io::Error,
    },
}

/// The driver marked a frame as damaged: the bytes are not what the camera saw.
#[derive(Debug, thiserror::Error)]
#[error("camera {camera}: the driver gave frame {seq} as damaged")]
pub struct CameraError {
    /// Which camera.
    pub camera: CameraId,
    /// The frame's number.
    pub seq: u64,
}

impl SourceError {
    /// The counter of a lost frame; `None` when none was lost or the whole source is gone.
    #[must_use]
    pub fn reason(&self) -> Option<Reason> {
        match self {
            Self::Frame(error) => Some(error.reason()),
            Self::Camera(_) => Some(Reason::DamagedBuffer),
            Self::Quiet | Self::Lost { .. } => None,
        }
    }
}
