use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use demeter_frame::{Frame, Pose, Stamp};

use super::board::{Arrival, Board};
use super::driver::{Driver, Shot, Stream};
use super::sequence::Sequence;
use super::{CameraFault, CameraSettings, Speed, longest_exposure};
use crate::{CameraError, Positions};

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
    pub(super) settings: CameraSettings,
    pub(super) driver: Box<dyn Driver>,
    pub(super) positions: Positions,
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
        let three = Duration::try_from_secs_f64(3.0 / self.settings.mode.rate).unwrap_or_default();
        let stall = self.patience.stall.max(three);
        let (mut patience, mut since) = (self.patience.first.max(stall), Instant::now());
        let mut exposure = Exposure::default();
        while !self.board.stopping() {
            if let Some(longest) = self.settings.smear.and_then(|smear| exposure.follow(smear, self.positions.speed()?))
            {
                stream.limit_exposure(longest);
            }
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
            return Err(CameraError { camera: self.settings.id.clone(), seq });
        }
        let layout = stream.layout();
        Ok(Frame {
            camera: self.settings.id.clone(),
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
            world_from_camera: self.pose(shot.mono_ns),
        })
    }

    /// Where the camera stood; unknown where the rig's speed is to be measured and is not.
    fn pose(&self, mono_ns: u64) -> Option<Pose> {
        let mount = self.settings.mount?;
        let way = match mount.speed {
            Speed::Given(speed) => speed * (mono_ns.saturating_sub(self.start_ns) as f64 * 1e-9),
            Speed::Measured { rightwards } => self.positions.driven(mono_ns)? * if rightwards { -1.0 } else { 1.0 },
        };
        Some(mount.pose(way))
    }
}

/// The exposure's limit while the speed is measured.
#[derive(Debug, Default)]
struct Exposure {
    longest: Option<f64>,
}

impl Exposure {
    /// Changes of the speed by a smaller share leave the limit: a camera needs a frame or two to follow (a guess).
    const STEADY: f64 = 0.2;
    /// Below this, metres a second, the rig stands, whatever the receiver's noise says.
    const STANDS: f64 = 0.05;

    /// The longest exposure in which the rig goes by `smear` metres at most, where it is to be set anew.
    fn follow(&mut self, smear: f64, speed: f64) -> Option<f64> {
        let longest = longest_exposure(speed.max(Self::STANDS), smear, 1.0);
        let same = self.longest.is_some_and(|before| (before - longest).abs() <= Self::STEADY * before);
        (!same).then(|| *self.longest.insert(longest))
    }
}

#[cfg(test)]
mod tests {
    use super::Exposure;

    #[test]
    fn the_exposure_follows_the_speed_and_not_its_noise() {
        let mut exposure = Exposure::default();
        let limits = [1.0, 1.1, 0.95, 2.0, 0.0, 0.01, 1.0].map(|speed| exposure.follow(0.002, speed));
        assert_eq!(limits, [Some(0.002), None, None, Some(0.001), Some(0.04), None, Some(0.002)]);
    }
}
