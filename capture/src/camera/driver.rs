use std::sync::Arc;
use std::time::Duration;

use demeter_frame::PixelFormat;

use super::CameraFault;

/// Opens one camera, as often as it takes.
pub(crate) trait Driver: Send + 'static {
    /// Finds the camera, sets its mode and makes it stream.
    fn open(&self) -> Result<Box<dyn Stream>, CameraFault>;
}

/// A camera that streams; dropped, it is closed.
pub(crate) trait Stream {
    /// What its frames are.
    fn layout(&self) -> Layout;

    /// The next frame, or `None` when none came in `wait`.
    fn grab(&mut self, wait: Duration) -> Result<Option<Shot>, CameraFault>;

    /// Sets the longest exposure, seconds, while it streams. A camera that cannot do that keeps what it was opened with.
    fn limit_exposure(&mut self, _longest: f64) {}
}

/// What a camera said its frames would be, checked against what was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) format: PixelFormat,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Bytes a row, raw formats only.
    pub(crate) stride: u32,
}

/// One exposure as the driver gave it.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    /// The driver's own count, which wraps around and starts anew.
    pub(crate) count: u32,
    /// On CLOCK_MONOTONIC.
    pub(crate) mono_ns: u64,
    pub(crate) bytes: Arc<[u8]>,
    /// The driver says that the bytes are not what the camera saw.
    pub(crate) damaged: bool,
}
