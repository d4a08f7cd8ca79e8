//! Time: a monotonic clock that orders, a wall clock that labels, and whether the wall clock may be trusted.

use std::fmt::Debug;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use demeter_frame::Stamp;
use jiff::{SignedDuration, Timestamp};
use rustix::time::{ClockId, clock_gettime};

/// One moment on both clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Nanoseconds since the boot; never goes back, whatever is done to the wall clock.
    pub mono_ns: u64,
    /// The wall clock, right or wrong.
    pub wall: Timestamp,
}

/// Where times come from; tests bring their own.
pub trait Clock: Debug + Send + Sync {
    /// Now.
    fn now(&self) -> Moment;

    /// The boot that `mono_ns` counts from.
    fn boot_id(&self) -> &str;

    /// Whether the wall clock has been set by something that knows the time.
    fn synchronised(&self) -> bool;
}

/// The wall time of a frame of a live camera, and whether it may be trusted.
///
/// Once the clock is synchronised, times are counted back from now along the monotonic clock. So a frame that was taken
/// before the wall clock was set has its right time as well.
#[must_use]
pub fn wall_time(clock: &dyn Clock, stamp: &Stamp) -> (String, bool) {
    let now = clock.now();
    let age = now.mono_ns.checked_sub(stamp.mono_ns).and_then(|age| i64::try_from(age).ok());
    let known = age.filter(|_| clock.synchronised() && clock.boot_id() == stamp.boot_id);
    match known.and_then(|age| now.wall.checked_sub(SignedDuration::from_nanos(age)).ok()) {
        Some(wall) => (wall.to_string(), true),
        None => (stamp.wall.clone(), false),
    }
}

/// This machine's clocks.
#[derive(Debug)]
pub struct SystemClock {
    boot_id: String,
    synchronised: AtomicBool,
}

impl SystemClock {
    /// The clocks of this boot, not trusted yet.
    #[must_use]
    pub fn new() -> Self {
        // Linux without /proc is not run on; were it so, all its boots would count as one.
        let boot_id = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        Self { boot_id: boot_id.trim().into(), synchronised: AtomicBool::new(false) }
    }

    /// Asks the kernel by way of systemd whether the clock is synchronised, and remembers the answer. It blocks.
    ///
    /// The kernel's own call, adjtimex, is one that the unit's ProtectClock forbids even for reading; timedated makes it
    /// for us, whichever program sets the clock. Without systemd nobody is trusted.
    pub fn ask(&self) {
        let mut asked = Command::new("timedatectl");
        asked.args(["show", "--property=NTPSynchronized", "--value"]).stdin(Stdio::null());
        // It would tell systemd in our name how it ended.
        asked.env_remove("NOTIFY_SOCKET");
        let yes = asked.output().is_ok_and(|answer| answer.stdout.trim_ascii() == b"yes");
        self.synchronised.store(yes, Ordering::Relaxed);
    }
}

impl Default for SystemClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Moment {
        let mono = clock_gettime(ClockId::Monotonic);
        let (seconds, nanoseconds) = (mono.tv_sec.unsigned_abs(), mono.tv_nsec.unsigned_abs());
        Moment { mono_ns: seconds * 1_000_000_000 + nanoseconds, wall: Timestamp::now() }
    }

    fn boot_id(&self) -> &str {
        &self.boot_id
    }

    fn synchronised(&self) -> bool {
        self.synchronised.load(Ordering::Relaxed)
    }
}
