use demeter_frame::Frame;

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
    /// Nothing more will come from this source.
    #[error("the source ended while reading {what}")]
    Lost {
        /// What was being read.
        what: String,
        /// What the system said.
        source: std::io::Error,
    },
}

impl SourceError {
    /// The counter of a lost frame; `None` when the whole source is gone.
    #[must_use]
    pub fn reason(&self) -> Option<Reason> {
        match self {
            Self::Frame(error) => Some(error.reason()),
            Self::Lost { .. } => None,
        }
    }
}
