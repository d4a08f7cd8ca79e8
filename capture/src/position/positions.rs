use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use demeter_frame::Stamp;

use super::track::{BRIDGED_NS, Track};
use super::{Fault, Fix, PositionHealth, PositionState};
use crate::camera::monotonic_ns;

/// Fixes that are kept while they come: ten minutes of twenty a second. A plant is placed seconds after its frame.
const KEPT: usize = 12_000;

/// A step back of the receiver's clock of less than this is a fix that comes again, seconds; a longer one is a clock that
/// was set.
const STEP_BACK: f64 = 10.0;

/// Steps of the receiver's clock and ours may differ by so much, seconds.
const STEP: f64 = 10.0;

/// Where the rig was and when, for whoever asks; cheap to clone. Without a receiver there is no position at any time.
#[derive(Clone, Debug, Default)]
pub struct Positions(Arc<Mutex<Inner>>);

#[derive(Debug, Default)]
struct Inner {
    tracks: BTreeMap<String, Track>,
    /// The boot that goes on, while a receiver is read.
    boot_id: Option<String>,
    health: PositionHealth,
}

impl Positions {
    /// The antenna's position at the time of a frame; `None` where no fix is near enough.
    #[must_use]
    pub fn at(&self, stamp: &Stamp) -> Option<Fix> {
        self.inner().tracks.get(&stamp.boot_id)?.at(stamp.mono_ns)
    }

    /// Whether a later call of [`Self::at`] may know more: a receiver is read, and the fix after the frame may still come.
    #[must_use]
    pub fn may_come(&self, stamp: &Stamp) -> bool {
        let inner = self.inner();
        let ours = inner.boot_id.as_ref() == Some(&stamp.boot_id);
        let last = inner.tracks.get(&stamp.boot_id).and_then(Track::last).map(|fix| fix.t_mono_ns);
        let awaited = last.is_some_and(|last| last < stamp.mono_ns && stamp.mono_ns - last < BRIDGED_NS);
        ours && awaited && monotonic_ns() < stamp.mono_ns.saturating_add(BRIDGED_NS)
    }

    /// Speed over ground now, metres a second.
    #[must_use]
    pub fn speed(&self) -> Option<f64> {
        self.current(|track| track.speed(monotonic_ns()))
    }

    /// Metres driven from the first fix up to a moment that is about now.
    #[must_use]
    pub fn driven(&self, t_mono_ns: u64) -> Option<f64> {
        self.current(|track| track.driven(t_mono_ns))
    }

    /// How the receiver does; `None` where there is none.
    #[must_use]
    pub fn health(&self) -> Option<PositionHealth> {
        let inner = self.inner();
        inner.boot_id.as_ref()?;
        let age = |fix: &Fix| monotonic_ns().saturating_sub(fix.t_mono_ns);
        let age = inner.health.last.as_ref().map(age);
        let state = match inner.health.state {
            PositionState::Fix if age.is_none_or(|age| age > BRIDGED_NS) => PositionState::NoFix,
            state => state,
        };
        Some(PositionHealth { state, last_fix_age: age.map(|age| age as f64 * 1e-9), ..inner.health.clone() })
    }

    /// The receiver's fixes after the first `seen`, the oldest first, as far as they are kept: ten minutes and more.
    #[must_use]
    pub fn since(&self, seen: u64) -> Vec<Fix> {
        let inner = self.inner();
        let new = usize::try_from(inner.health.fixes.saturating_sub(seen)).unwrap_or(usize::MAX);
        let track = inner.boot_id.as_ref().and_then(|boot_id| inner.tracks.get(boot_id));
        track.map_or_else(Vec::new, |track| track.newest(new))
    }

    pub(crate) fn of_receiver(receiver: String, boot_id: String) -> Self {
        let health = PositionHealth { receiver, ..PositionHealth::default() };
        Self(Arc::new(Mutex::new(Inner { boot_id: Some(boot_id), health, ..Inner::default() })))
    }

    /// Takes a fix of a recording in; `false` when it is older than the one before.
    pub(crate) fn replay(&self, fix: Fix, boot_id: String) -> bool {
        self.inner().tracks.entry(boot_id).or_default().push(fix, usize::MAX)
    }

    /// Takes what a line of the receiver came to.
    pub(super) fn take(&self, read: Result<Option<Fix>, Fault>) {
        let mut inner = self.inner();
        let fix = match read {
            Err(fault) => return inner.count(fault),
            Ok(fix) => fix,
        };
        inner.health.sentences += 1;
        if inner.health.state != PositionState::Fix {
            inner.health.state = PositionState::NoFix;
        }
        let Some(fix) = fix else { return };
        match inner.health.last.as_ref().and_then(|last| clock_fault(last, &fix)) {
            Some(Fault::StaleTime) => return inner.count(Fault::StaleTime),
            Some(fault) => inner.count(fault),
            None => {}
        }
        inner.fix(fix);
    }

    /// Says that the receiver cannot be read, and why.
    pub(super) fn lost(&self, error: &std::io::Error) {
        let mut inner = self.inner();
        let message = error.to_string();
        if inner.health.last_error.as_ref() != Some(&message) {
            tracing::warn!("{}: {message}", inner.health.receiver);
        }
        (inner.health.state, inner.health.last_error) = (PositionState::Lost, Some(message));
    }

    fn current<T>(&self, ask: impl FnOnce(&Track) -> Option<T>) -> Option<T> {
        let inner = self.inner();
        ask(inner.tracks.get(inner.boot_id.as_ref()?)?)
    }

    /// A panic elsewhere leaves whole values behind: every change is one assignment or one push.
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn count(&mut self, fault: Fault) {
        *self.health.faults.entry(fault.name()).or_default() += 1;
    }

    fn fix(&mut self, fix: Fix) {
        let Some(boot_id) = self.boot_id.clone() else { return };
        let fix = Fix { boot_id: Some(boot_id.clone()), ..fix };
        if self.tracks.entry(boot_id).or_default().push(fix.clone(), KEPT) {
            self.health.fixes += 1;
            self.health.state = PositionState::Fix;
            self.health.last = Some(fix);
        }
    }
}

/// What is wrong with a fix's time, beside the fix before.
fn clock_fault(last: &Fix, fix: &Fix) -> Option<Fault> {
    let step = fix.time?.duration_since(last.time?).as_secs_f64();
    let ours = fix.t_mono_ns.saturating_sub(last.t_mono_ns) as f64 * 1e-9;
    match step {
        _ if step <= 0.0 && step > -STEP_BACK => Some(Fault::StaleTime),
        _ if (step - ours).abs() > STEP => Some(Fault::TimeJump),
        _ => None,
    }
}
