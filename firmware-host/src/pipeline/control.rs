use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use demeter_capture::{CamerasHealth, Lens, PositionHealth, Positions};
use demeter_frame::{CameraId, Stamp};

use super::beat::Beat;
use super::views::Views;
use crate::status::CameraStatus;

/// How often a stage that rests or waits for room looks whether it may go on.
const GLANCE: Duration = Duration::from_millis(50);

/// Longest rest after one frame: a slow frame on a hot box must not look like a stop.
const MAX_REST: Duration = Duration::from_secs(5);

/// What a run and whoever watches over it tell each other while it runs.
#[derive(Debug, Default)]
pub struct Control {
    /// The heartbeat of the first stage: source and gate. Waiting for the source is waiting.
    pub reader: Beat,
    /// Of the second: the network and what follows it.
    pub looker: Beat,
    /// Of the last: fitting and the store.
    pub keeper: Beat,
    dropped: AtomicU64,
    /// One part of so many is worked, the others are rested; 0 is 1.
    slowness: AtomicU32,
    full: AtomicBool,
    cameras: OnceLock<CamerasHealth>,
    /// What the cameras see.
    pub(super) views: Views,
    positions: OnceLock<Positions>,
    bad_lenses: Mutex<Vec<(CameraId, Lens)>>,
    /// When everything must have ended; unset while the run goes on.
    deadline: OnceLock<Instant>,
}

impl Control {
    /// Of a run whose frames are shown in `views`.
    #[must_use]
    pub fn showing(views: Views) -> Self {
        Self { views, ..Self::default() }
    }

    /// Ends the run: no new frames are read, and what is in hand may be finished until `grace` is over. What is not
    /// done by then is left out whole.
    pub fn stop(&self, grace: Duration) {
        self.deadline.get_or_init(|| Instant::now() + grace);
    }

    /// Makes the run work only one part in `times` of the time (1: all of it).
    pub fn slow_down(&self, times: u32) {
        self.slowness.store(times, Ordering::Relaxed);
    }

    /// Says whether the disk has room; without it plants wait to be stored.
    pub fn storage_full(&self, full: bool) {
        self.full.store(full, Ordering::Relaxed);
    }

    /// Whether plants wait for room on the disk.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.full.load(Ordering::Relaxed)
    }

    /// Live frames that were dropped because the stages behind were busy.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Lets whoever watches see how the cameras do.
    pub fn show_cameras(&self, health: CamerasHealth) {
        self.cameras.get_or_init(|| health);
    }

    /// Lets the run, and whoever watches, see where the rig is.
    pub fn show_positions(&self, positions: Positions) {
        self.positions.get_or_init(|| positions);
    }

    /// Where the rig was and is; nowhere when nobody tells.
    #[must_use]
    pub fn positions(&self) -> Positions {
        self.positions.get().cloned().unwrap_or_default()
    }

    /// How the satellite receiver does, where there is one.
    #[must_use]
    pub fn position_health(&self) -> Option<PositionHealth> {
        self.positions.get()?.health()
    }

    /// How the cameras do.
    #[must_use]
    pub fn cameras(&self) -> Vec<CameraStatus> {
        let cameras = self.cameras.get().map_or_else(|| self.views.cameras(), CamerasHealth::read);
        let bad = self.bad_lenses.lock().unwrap_or_else(PoisonError::into_inner);
        let lens = |id: &CameraId| bad.iter().find(|(camera, _)| camera == id).map(|(_, lens)| lens.to_string());
        cameras.into_iter().map(|health| CameraStatus { lens: lens(&health.id), health }).collect()
    }

    pub(super) fn show_lenses(&self, bad: Vec<(CameraId, Lens)>) {
        *self.bad_lenses.lock().unwrap_or_else(PoisonError::into_inner) = bad;
    }

    /// The stages by name, in the order of the data path.
    #[must_use]
    pub fn beats(&self) -> [(&'static str, &Beat); 3] {
        [("reader", &self.reader), ("looker", &self.looker), ("keeper", &self.keeper)]
    }

    pub(super) fn stopping(&self) -> bool {
        self.deadline.get().is_some()
    }

    pub(super) fn overdue(&self) -> bool {
        self.deadline.get().is_some_and(|deadline| Instant::now() >= *deadline)
    }

    pub(super) fn drop_frame(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
        metrics::counter!("demeter_frames_dropped_total").increment(1);
    }

    /// Rests as long as slowness asks after so much work.
    pub(super) fn rest(&self, worked: Duration) {
        let parts = self.slowness.load(Ordering::Relaxed).saturating_sub(1);
        let until = Instant::now() + worked.saturating_mul(parts).min(MAX_REST);
        wait_while(|| Instant::now() < until && !self.stopping());
    }

    /// Waits for the position at the time of a frame, where the fix after it is still to come.
    pub(super) fn wait_for_position(&self, stamp: &Stamp) {
        wait_while(|| self.positions.get().is_some_and(|positions| positions.may_come(stamp)) && !self.overdue());
    }

    /// Waits for room on the disk, at most until the run must have ended.
    pub(super) fn wait_for_room(&self) {
        wait_while(|| self.is_full() && !self.overdue());
    }
}

fn wait_while(hold: impl Fn() -> bool) {
    while hold() {
        std::thread::sleep(GLANCE);
    }
}
