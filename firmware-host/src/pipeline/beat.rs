use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A stage's heartbeat. A stage that waits for work is as good as new however long it waits; one that has had the same
/// item in hand for long is stuck.
#[derive(Debug, Default)]
pub struct Beat {
    /// When the item in hand was taken up.
    since: Mutex<Option<Instant>>,
}

/// An item in hand; dropped when it is done.
#[must_use]
pub struct Working<'a>(&'a Beat);

impl Beat {
    /// Says that an item was taken up.
    pub fn work(&self) -> Working<'_> {
        self.set(Some(Instant::now()));
        Working(self)
    }

    /// How long the item in hand has taken by `now`; `None` while the stage waits.
    #[must_use]
    pub fn busy(&self, now: Instant) -> Option<Duration> {
        let since = *self.since.lock().unwrap_or_else(PoisonError::into_inner);
        since.map(|since| now.saturating_duration_since(since))
    }

    fn set(&self, since: Option<Instant>) {
        *self.since.lock().unwrap_or_else(PoisonError::into_inner) = since;
    }
}

impl Working<'_> {
    /// Waits for something else than the stage's own work, and takes the item up again.
    pub(super) fn pause<T>(&self, wait: impl FnOnce() -> T) -> T {
        self.0.set(None);
        let waited = wait();
        self.0.set(Some(Instant::now()));
        waited
    }
}

impl Drop for Working<'_> {
    fn drop(&mut self) {
        self.0.set(None);
    }
}
