//! Everything that can happen to the daemon, one at a time.

use std::io;
use std::time::Duration;

use rustix::process::Signal as Number;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::time::{Interval, MissedTickBehavior, interval};

use super::line::End;
use crate::error::CommandError;

/// Threads' news that wait to be taken up: each of the four who send has one at a time.
const NEWS_WAITING: usize = 8;

/// What happened.
#[derive(Debug)]
pub(super) enum Event {
    /// A step of time is over.
    Tick,
    /// The program is to end: the service manager, somebody at the keyboard, or a power supply that is about to fail.
    Stop(&'static str),
    /// The configuration is to be read again.
    Reload,
    /// The store was asked; whether it answered well.
    StoreAnswered(bool),
    /// The line from frames to plants is over.
    LineEnded(End),
    /// The store broke under the sync.
    SyncBroke(CommandError),
    /// The page is not served any more.
    ApiEnded(io::Result<()>),
}

/// Where events come from.
pub(super) struct Events {
    ticks: Interval,
    terminate: Signal,
    interrupt: Signal,
    power: Signal,
    hangup: Signal,
    news: Receiver<Event>,
}

impl Events {
    /// From here on no signal ends the program by itself. The sender is for threads and tasks with news.
    pub(super) fn new(step: Duration) -> io::Result<(Self, Sender<Event>)> {
        let (sender, news) = channel(NEWS_WAITING);
        let mut ticks = interval(step);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let events = Self {
            ticks,
            terminate: signal(SignalKind::terminate())?,
            interrupt: signal(SignalKind::interrupt())?,
            power: signal(SignalKind::from_raw(Number::POWER.as_raw()))?,
            hangup: signal(SignalKind::hangup())?,
            news,
        };
        Ok((events, sender))
    }

    /// Waits for the next.
    pub(super) async fn next(&mut self) -> Event {
        tokio::select! {
            _ = self.terminate.recv() => Event::Stop("SIGTERM"),
            _ = self.interrupt.recv() => Event::Stop("SIGINT"),
            _ = self.power.recv() => Event::Stop("SIGPWR"),
            _ = self.hangup.recv() => Event::Reload,
            // The daemon itself keeps a sender, so this never ends.
            Some(event) = self.news.recv() => event,
            _ = self.ticks.tick() => Event::Tick,
        }
    }
}
