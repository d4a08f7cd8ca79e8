use std::future::Future;
use std::time::Duration;

use jiff::Timestamp;

use crate::clock::{Clock, SystemClock};

/// The time as the sync needs it; tests bring their own.
pub trait SyncClock {
    /// The wall clock.
    fn now(&self) -> Timestamp;

    /// Whether it is right: certificates cannot be judged by a clock that is wrong.
    fn trusted(&self) -> bool;

    /// Waits.
    fn sleep(&self, duration: Duration) -> impl Future<Output = ()>;
}

impl<C: SyncClock> SyncClock for &C {
    fn now(&self) -> Timestamp {
        (**self).now()
    }

    fn trusted(&self) -> bool {
        (**self).trusted()
    }

    fn sleep(&self, duration: Duration) -> impl Future<Output = ()> {
        (**self).sleep(duration)
    }
}

impl SyncClock for SystemClock {
    fn now(&self) -> Timestamp {
        Clock::now(self).wall
    }

    fn trusted(&self) -> bool {
        self.ask();
        self.synchronised()
    }

    async fn sleep(&self, duration: Duration) {
        tokio::time::sleep(duration).await;
    }
}
