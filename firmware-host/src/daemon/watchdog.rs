//! Who is alive: systemd's watchdog is fed only while every stage moves and the store answers.

use std::time::{Duration, Instant};

use crate::pipeline::{Beat, Control};
use crate::status::Stage;

/// A stage that has had one item in hand for longer is stuck, and a store that has not answered for longer is silent.
/// The slowest item known is a large plant's fit, seconds on a small box; the rest is a guess.
pub const STUCK: Duration = Duration::from_secs(15);

/// What the stages do now.
#[must_use]
pub fn stages(control: &Control, now: Instant) -> Vec<Stage> {
    let stage = |(name, beat): (_, &Beat)| {
        let busy = beat.busy(now);
        Stage { name, busy_seconds: busy.map(|busy| busy.as_secs_f64()), stuck: busy.is_some_and(|busy| busy > STUCK) }
    };
    control.beats().into_iter().map(stage).collect()
}

/// Whether systemd's watchdog may be fed.
#[must_use]
pub fn alive(stages: &[Stage], store: &StoreBeat, now: Instant) -> bool {
    !store.silent(now) && !stages.iter().any(|stage| stage.stuck)
}

/// The store's own heartbeat: it is asked, and has to answer.
#[derive(Debug)]
pub struct StoreBeat {
    answered: Instant,
    asked: bool,
}

impl StoreBeat {
    /// A store that has just been opened.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self { answered: now, asked: false }
    }

    /// Whether to ask it now: one question at a time.
    pub fn ask(&mut self) -> bool {
        !std::mem::replace(&mut self.asked, true)
    }

    /// Takes the answer to the question.
    pub fn answer(&mut self, well: bool, now: Instant) {
        self.asked = false;
        if well {
            self.answered = now;
        }
    }

    /// No answer has come for too long.
    #[must_use]
    pub fn silent(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.answered) > STUCK
    }
}
