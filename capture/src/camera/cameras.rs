use std::io;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use demeter_frame::Frame;

use super::board::Board;
use super::driver::Driver;
use super::supervisor::{Patience, Supervisor};
use super::{Backend, CameraHealth, CameraSettings};
use crate::{Positions, Source, SourceError, libcamera, v4l2};

/// How long [`Source::next`] waits before it says that all is quiet.
const QUIET: Duration = Duration::from_millis(500);

/// How long closing waits for the drivers: one that hangs is left to the kernel.
const CLOSING: Duration = Duration::from_secs(3);

/// Where the kernel tells which boot this is.
const BOOT_ID: &str = "/proc/sys/kernel/random/boot_id";

/// The cameras of a rig as one [`Source`]: frames of all of them by the time they were taken, on one monotonic clock.
///
/// Each camera has a thread of its own that opens it, again and again where it must: one that stalls, fails or is
/// unplugged is [`CameraState::Lost`](super::CameraState) while the others go on. Frames that nobody fetches are thrown
/// away, the oldest first, and counted.
#[derive(Debug)]
pub struct Cameras {
    board: Arc<Board>,
    threads: Vec<JoinHandle<()>>,
}

/// How the cameras of a rig do, for whoever watches; cheap to clone.
#[derive(Clone, Debug)]
pub struct CamerasHealth(Arc<Board>);

impl CamerasHealth {
    /// Every camera, in the order of the settings.
    #[must_use]
    pub fn read(&self) -> Vec<CameraHealth> {
        self.0.health()
    }
}

impl Cameras {
    /// Begins to open the cameras; those that are not there yet are waited for. `positions` tell how fast the rig drives
    /// where the settings do not.
    ///
    /// # Errors
    /// The system's, when it gives no threads.
    pub fn open(settings: &[CameraSettings], positions: &Positions) -> io::Result<Self> {
        Self::with(settings, positions, driver, Patience::default())
    }

    pub(super) fn with(
        settings: &[CameraSettings],
        positions: &Positions,
        driver: impl Fn(&CameraSettings) -> Box<dyn Driver>,
        patience: Patience,
    ) -> io::Result<Self> {
        let boot_id: Arc<str> = boot_id()?.into();
        let start_ns = monotonic_ns();
        let mut cameras = Self { board: Arc::new(Board::new(settings)), threads: Vec::new() };
        for (index, camera) in settings.iter().enumerate() {
            let (board, boot_id, driver) = (cameras.board.clone(), boot_id.clone(), driver(camera));
            let (settings, positions) = (camera.clone(), positions.clone());
            let thread = std::thread::Builder::new().name(format!("camera {}", camera.id)).spawn(move || {
                let (boot_id, board) = (&*boot_id, &*board);
                Supervisor { index, settings, driver, positions, boot_id, start_ns, patience, board }.run();
            });
            cameras.threads.push(thread?);
        }
        Ok(cameras)
    }

    /// How they do, from now on and from anywhere.
    #[must_use]
    pub fn health(&self) -> CamerasHealth {
        CamerasHealth(self.board.clone())
    }
}

impl Source for Cameras {
    /// As the trait says; [`SourceError::Quiet`] after half a second without a frame from any camera.
    fn next(&mut self) -> Result<Option<Frame>, SourceError> {
        self.board.next(QUIET)
    }
}

impl Drop for Cameras {
    fn drop(&mut self) {
        self.board.stop();
        let deadline = Instant::now() + CLOSING;
        while self.threads.iter().any(|thread| !thread.is_finished()) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

fn driver(settings: &CameraSettings) -> Box<dyn Driver> {
    let settings = settings.clone();
    match settings.backend {
        Backend::V4l2 => Box::new(v4l2::Camera(settings)),
        Backend::Libcamera => Box::new(libcamera::Camera(settings)),
        #[cfg(feature = "nokhwa")]
        Backend::Nokhwa => Box::new(crate::nokhwa::Camera::new(settings)),
    }
}

/// Which boot this is, as the kernel tells.
pub(crate) fn boot_id() -> io::Result<String> {
    Ok(std::fs::read_to_string(BOOT_ID)?.trim().to_owned())
}

/// CLOCK_MONOTONIC, nanoseconds: what the kernel stamps frames with.
pub(crate) fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    // Neither part is ever negative on this clock.
    now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs()
}
