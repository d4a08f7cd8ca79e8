//! Webcams of laptops through the crate nokhwa, whatever their system: for trying things out, not for a rig.
//!
//! nokhwa waits for ever when frames stop. So a thread of its own opens the camera and asks for frames, and the supervisor
//! gives up on it as on any camera that stalls. A thread that hangs cannot be ended; no other is started beside it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use demeter_frame::PixelFormat;
use nokhwa::NokhwaError;
use nokhwa::utils::{CameraFormat, CameraIndex, FrameFormat, RequestedFormat, RequestedFormatType, Resolution};

use crate::camera::driver::{Driver, Layout, Shot, Stream};
use crate::camera::monotonic_ns;
use crate::{CameraFault, CameraSettings};

const PROGRAM: &str = "nokhwa";

/// A camera by its number or by nokhwa's name of it.
pub(crate) struct Camera {
    settings: CameraSettings,
    /// A thread is at the camera.
    taken: Arc<AtomicBool>,
}

impl Camera {
    pub(crate) fn new(settings: CameraSettings) -> Self {
        Self { settings, taken: Arc::default() }
    }
}

impl Driver for Camera {
    fn open(&self) -> Result<Box<dyn Stream>, CameraFault> {
        if self.taken.swap(true, Ordering::Relaxed) {
            return Err(fault("the last attempt still waits for a frame: only a new start of the program helps"));
        }
        let (give, shots) = sync_channel(1);
        let (settings, taken) = (self.settings.clone(), Taken(self.taken.clone()));
        std::thread::spawn(move || {
            let _taken = taken;
            if let Err(error) = film(&settings, &give) {
                // Nobody listens when the supervisor gave up before.
                give.send(Err(error)).unwrap_or_default();
            }
        });
        let mode = self.settings.mode;
        let stride = mode.format.row_bytes(mode.width) as u32;
        Ok(Box::new(Film {
            shots,
            layout: Layout { format: mode.format, width: mode.width, height: mode.height, stride },
        }))
    }
}

/// Says that no thread is at the camera any more, however it ended.
struct Taken(Arc<AtomicBool>);

impl Drop for Taken {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Relaxed);
    }
}

/// Asks for frames until nobody wants them.
fn film(settings: &CameraSettings, to: &SyncSender<Result<Shot, CameraFault>>) -> Result<(), CameraFault> {
    let mode = settings.mode;
    let index =
        settings.device.parse().map_or_else(|_| CameraIndex::String(settings.device.clone()), CameraIndex::Index);
    let (resolution, format) = (Resolution::new(mode.width, mode.height), name(mode.format));
    let asked = CameraFormat::new(resolution, format, mode.rate.round() as u32);
    let formats = [format];
    let request = RequestedFormat::with_formats(RequestedFormatType::Exact(asked), &formats);
    let failed = |error: NokhwaError| fault(error);
    let mut camera = nokhwa::Camera::new(index, request).map_err(failed)?;
    camera.open_stream().map_err(failed)?;
    for count in 0.. {
        let frame = camera.frame().map_err(failed)?;
        if (frame.resolution(), frame.source_frame_format()) != (resolution, format) {
            let found = format!("{} {}", frame.source_frame_format(), frame.resolution());
            return Err(CameraFault::Mode { expected: mode.to_string(), found });
        }
        let shot = Shot { count, mono_ns: monotonic_ns(), bytes: frame.buffer().into(), damaged: false };
        if to.send(Ok(shot)).is_err() {
            break;
        }
    }
    Ok(())
}

struct Film {
    shots: Receiver<Result<Shot, CameraFault>>,
    layout: Layout,
}

impl Stream for Film {
    fn layout(&self) -> Layout {
        self.layout
    }

    fn grab(&mut self, wait: Duration) -> Result<Option<Shot>, CameraFault> {
        match self.shots.recv_timeout(wait) {
            Ok(shot) => shot.map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(fault("its thread ended")),
        }
    }
}

fn fault(message: impl ToString) -> CameraFault {
    CameraFault::Child { program: PROGRAM, message: message.to_string() }
}

fn name(format: PixelFormat) -> FrameFormat {
    match format {
        PixelFormat::Jpeg => FrameFormat::MJPEG,
        PixelFormat::Rgb24 => FrameFormat::RAWRGB,
        PixelFormat::Yuyv => FrameFormat::YUYV,
        PixelFormat::Nv12 => FrameFormat::NV12,
        PixelFormat::Grey => FrameFormat::GRAY,
    }
}
