use std::time::Duration;

/// The shortest wait after a failure: no more than two requests a minute go to a server that does not answer.
pub(super) const SHORTEST: Duration = Duration::from_secs(30);
/// The longest: a depot's network is there for minutes when a tractor comes in (a guess).
const LONGEST: Duration = Duration::from_secs(20 * 60);

/// How long to wait after each failure: twice as long each time, and up to half as long again by lot, so that a fleet
/// that lost its server together does not come back together.
#[derive(Debug)]
pub struct Backoff {
    failures: u32,
    lots: fastrand::Rng,
}

impl Backoff {
    /// The seed decides the lots.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { failures: 0, lots: fastrand::Rng::with_seed(seed) }
    }

    /// After a failure: how long to wait.
    pub fn failed(&mut self) -> Duration {
        // Beyond this the longest wait is reached whatever the lots say.
        let doubled = SHORTEST * 2_u32.pow(self.failures.min(10));
        self.failures += 1;
        doubled.min(LONGEST).mul_f64(1.0 + self.lots.f64() / 2.0)
    }

    /// After something arrived: the next failure waits shortly again.
    pub fn succeeded(&mut self) {
        self.failures = 0;
    }

    /// Failures since something arrived.
    #[must_use]
    pub fn failures(&self) -> u32 {
        self.failures
    }
}
