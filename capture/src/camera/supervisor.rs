use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use demeter_frame::{CameraId, Frame, Stamp};

use super::board::{Arrival, Board};
use super::driver::{Driver, Shot, Stream};
use super::sequence::Sequence;
use super::{CameraFault, Mount};
use crate::CameraError;

/// How long a camera may take over things.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// For its first frame: webcams take a second or two to start their sensor (a guess).
    pub(super) first: Duration,
    /// Between frames (spec/reliability.md 25), or three frames where the rate is lower.
    pub(super) stall: Duration,
    /// Before it is looked for again when it is not there. Looking costs one call a device.
    pub(super) absent: Duration,
    /// Before the first new attempt when it is there and fails; each further one waits twice as long.
    pub(super) retry: Duration,
    /// The longest wait before an attempt: with the time to open, below the 5 s of spec/reliability.md 22.
    pub(super) longest: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            first: Duration::from_secs(5),
            stall: Duration::from_secs(2),
            absent: Duration::from_millis(250),
            retry: Duration::from_millis(100),
            longest: Duration::from_secs(2),
        }
    }
}

/// How often a thread that waits for a frame looks whether it is to stop.
const GLANCE: Duration = Duration::from_millis(200);

/// One camera's thread: opens it, passes its frames on, and begins again whenever something goes wrong.
pub(super) struct Supervisor<'a> {
    pub(super) index: usize,
    pub(super) id: CameraId,
    pub(super) driver: Box<dyn Driver>,
    pub(super) rate: f64,
    pub(super) mount: Option<Mount>,
    pub(super) boot_id: &'a str,
    /// Where the world begins: the monotonic time at which the cameras were opened.
    pub(super) start_ns: u64,
    pub(super) patience: Patience,
    pub(super) board: &'a Board,
}

impl Supervisor<'_> {
    /// Runs until the board says to stop.
    pub(super) fn run(&self) {
        let mut sequence = Sequence::default();
        let mut failures = 0;
        while !self.board.stopping() {
            let before = sequence.next();
            let ended = catch_unwind(AssertUnwindSafe(|| {
                let mut stream = self.driver.open()?;
                sequence.reopened();
                self.pump(&mut *stream, &mut sequence)
            }));
            let fault = match ended {
                Ok(Ok(())) => return,
                Ok(Err(fault)) => fault,
                Err(_panic) => CameraFault::Panicked,
            };
            self.board.lost(self.index, &fault);
            failures = if sequence.next() > before { 0 } else { failures + 1 };
            self.board.rest(match fault {
                CameraFault::Missing { .. } => self.patience.absent,
                _ => self.patience.retry.saturating_mul(1 << failures.min(8)).min(self.patience.longest),
            });
        }
    }

    /// Passes frames on until it is to stop.
    fn pump(&self, stream: &mut dyn Stream, sequence: &mut Sequence) -> Result<(), CameraFault> {
        let three = Duration::try_from_secs_f64(3.0 / self.rate).unwrap_or_default();
        let stall = self.patience.stall.max(three);
        let (mut patience, mut since) = (self.patience.first.max(stall), Instant::now());
        while !self.board.stopping() {
            match stream.grab(GLANCE.min(stall))? {
                Some(shot) => {
                    let (seq, missed) = sequence.number(shot.count);
                    let mono_ns = shot.mono_ns;
                    self.board.push(self.index, Arrival { mono_ns, frame: self.frame(stream, shot, seq) }, missed);
                    (patience, since) = (stall, Instant::now());
                }
                None if since.elapsed() >= patience => return Err(CameraFault::Stalled { waited: since.elapsed() }),
                None => {}
            }
        }
        Ok(())
    }

    fn frame(&self, stream: &dyn Stream, shot: Shot, seq: u64) -> Result<Frame, CameraError> {
        if shot.damaged {
            return Err(CameraError { camera: self.id.clone(), seq });
        }
        let layout = stream.layout();
        let seconds = shot.mono_ns.saturating_sub(self.start_ns) as f64 * 1e-9;
        Ok(Frame {
            camera: self.id.clone(),
            seq,
            stamp: Stamp {
                mono_ns: shot.mono_ns,
                wall: jiff::Timestamp::now().to_string(),
                boot_id: self.boot_id.to_owned(),
            },
            format: layout.format,
            width: layout.width,
            height: layout.height,
            stride: layout.stride,
            bytes: shot.bytes,
            world_from_camera: self.mount.map(|mount| mount.pose(seconds)),
        })
    }
}
