use std::io;
use std::time::Duration;

/// Why a camera gives no frames for now. It is opened again whatever the reason.
#[derive(Debug, thiserror::Error)]
pub enum CameraFault {
    /// Nothing is plugged in there.
    #[error("expected a camera at {expected:?}, found {}", if found.is_empty() { "none at all" } else { found })]
    Missing {
        /// The path asked for.
        expected: String,
        /// The paths that have one.
        found: String,
    },
    /// The driver refuses, or the camera is gone.
    #[error("{what}")]
    Refused {
        /// What was asked for.
        what: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// No room for this camera's frames on its bus.
    #[error(
        "the USB bus has no room left for this camera: give it a port of another controller (not of the same hub), or \
         choose jpeg, a smaller size or a lower rate for the cameras on this bus"
    )]
    Bandwidth {
        /// What the system said.
        source: io::Error,
    },
    /// The camera does something else than was asked for.
    #[error("expected {expected}, the camera gives {found}")]
    Mode {
        /// The mode asked for.
        expected: String,
        /// What it said it would do.
        found: String,
    },
    /// It streams, and no frame comes.
    #[error("no frame for {:.1} s", waited.as_secs_f64())]
    Stalled {
        /// How long.
        waited: Duration,
    },
    /// The program that reads the camera ended or says what nobody understands.
    #[error("{program}: {message}")]
    Child {
        /// Its name.
        program: &'static str,
        /// What it said last, or how it ended.
        message: String,
    },
    /// A driver library panicked, as they do on devices that they do not know.
    #[error("the driver library panicked")]
    Panicked,
}

impl CameraFault {
    /// An error of the system, on the way to something.
    pub(crate) fn refused(what: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Refused { what, source }
    }
}
