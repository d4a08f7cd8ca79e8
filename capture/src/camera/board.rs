use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use demeter_frame::Frame;

use super::health::RATE_FRAMES;
use super::{CameraFault, CameraHealth, CameraSettings, CameraState};
use crate::{CameraError, SourceError};

/// Frames of one camera that wait to be fetched: a second at 30 a second, which a slow disk may take now and then.
const WAITING: usize = 30;

/// Bytes of them: a second of 1080p MJPEG, and one raw frame of any size in any case.
const WAITING_BYTES: usize = 16 << 20;

/// What the cameras' threads and whoever fetches frames share.
#[derive(Debug)]
pub(super) struct Board {
    lines: Mutex<Lines>,
    changed: Condvar,
}

#[derive(Debug)]
struct Lines {
    stopping: bool,
    cameras: Vec<Line>,
}

/// One camera's frames and health.
#[derive(Debug)]
struct Line {
    waiting: VecDeque<Arrival>,
    health: CameraHealth,
    last: Option<Instant>,
    /// When the last frames were taken, nanoseconds; none since before the camera was lost.
    stamps: VecDeque<u64>,
}

/// A frame, or the place of one that was damaged.
#[derive(Debug)]
pub(super) struct Arrival {
    pub(super) mono_ns: u64,
    pub(super) frame: Result<Frame, CameraError>,
}

impl Line {
    /// Frames a second, as their stamps tell.
    fn rate(&self) -> Option<f64> {
        let seconds = self.stamps.back()?.checked_sub(*self.stamps.front()?)? as f64 * 1e-9;
        (seconds > 0.0).then(|| (self.stamps.len() - 1) as f64 / seconds)
    }

    /// Held by the frames that wait.
    fn bytes(&self) -> usize {
        self.waiting.iter().filter_map(|arrival| arrival.frame.as_ref().ok()).map(|frame| frame.bytes.len()).sum()
    }
}

impl Board {
    pub(super) fn new(settings: &[CameraSettings]) -> Self {
        let line = |settings: &CameraSettings| Line {
            waiting: VecDeque::with_capacity(WAITING),
            health: CameraHealth::new(settings.id.clone(), &settings.device),
            last: None,
            stamps: VecDeque::with_capacity(RATE_FRAMES + 1),
        };
        let cameras = settings.iter().map(line).collect();
        Self { lines: Mutex::new(Lines { stopping: false, cameras }), changed: Condvar::new() }
    }

    /// A panic elsewhere leaves whole values behind: every change below is one assignment or one push.
    fn lines(&self) -> MutexGuard<'_, Lines> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn stop(&self) {
        self.lines().stopping = true;
        self.changed.notify_all();
    }

    pub(super) fn stopping(&self) -> bool {
        self.lines().stopping
    }

    /// Sleeps, but not beyond a stop.
    pub(super) fn rest(&self, time: Duration) {
        let waited = self.changed.wait_timeout_while(self.lines(), time, |lines| !lines.stopping);
        drop(waited);
    }

    /// Puts down what a camera gave; the oldest frame makes room when nobody fetches them.
    pub(super) fn push(&self, camera: usize, arrival: Arrival, missed: u64) {
        let mut lines = self.lines();
        let line = &mut lines.cameras[camera];
        match arrival.frame {
            Ok(_) => line.health.frames += 1,
            Err(_) => line.health.damaged += 1,
        }
        line.health.missed += missed;
        if line.health.state == CameraState::Lost && line.last.is_some() {
            line.health.reopened += 1;
            tracing::info!("camera {}: frames again", line.health.id);
        }
        line.health.state = CameraState::Streaming;
        line.last = Some(Instant::now());
        line.stamps.push_back(arrival.mono_ns);
        if line.stamps.len() > RATE_FRAMES + 1 {
            line.stamps.pop_front();
        }
        line.waiting.push_back(arrival);
        while line.waiting.len() > WAITING || line.waiting.len() > 1 && line.bytes() > WAITING_BYTES {
            line.waiting.pop_front();
            line.health.dropped += 1;
        }
        self.changed.notify_all();
    }

    /// Says that a camera gives no frames, and why; the same reason again is no news.
    pub(super) fn lost(&self, camera: usize, fault: &CameraFault) {
        let mut message = fault.to_string();
        if let Some(cause) = std::error::Error::source(fault) {
            message = format!("{message}: {cause}");
        }
        let mut lines = self.lines();
        let line = &mut lines.cameras[camera];
        line.stamps.clear();
        let health = &mut line.health;
        if health.last_error.as_ref() != Some(&message) || health.state == CameraState::Streaming {
            tracing::warn!("camera {}: {message}", health.id);
        }
        health.last_error = Some(message);
        health.state = CameraState::Lost;
    }

    /// The oldest frame that waits; [`SourceError::Quiet`] when there was none for so long.
    pub(super) fn next(&self, patience: Duration) -> Result<Option<Frame>, SourceError> {
        let none = |lines: &mut Lines| !lines.stopping && lines.cameras.iter().all(|line| line.waiting.is_empty());
        let waited = self.changed.wait_timeout_while(self.lines(), patience, none);
        let (mut lines, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let oldest = lines.cameras.iter_mut().filter_map(|line| Some((line.waiting.front()?.mono_ns, line)));
        match oldest.min_by_key(|(mono_ns, _)| *mono_ns).and_then(|(_, line)| line.waiting.pop_front()) {
            Some(arrival) => Ok(Some(arrival.frame?)),
            None if lines.stopping => Ok(None),
            None => Err(SourceError::Quiet),
        }
    }

    pub(super) fn health(&self) -> Vec<CameraHealth> {
        let aged = |line: &Line| CameraHealth {
            rate: line.rate(),
            last_frame_age: line.last.map(|last| last.elapsed().as_secs_f64()),
            ..line.health.clone()
        };
        self.lines().cameras.iter().map(aged).collect()
    }
}
