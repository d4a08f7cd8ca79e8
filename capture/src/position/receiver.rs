use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::lines::Lines;
use super::nmea::Nmea;
use super::port::Port;
use super::{Fault, Fix, Positions, ReceiverSource, gpsd};
use crate::camera::{boot_id, monotonic_ns};

/// Before the first new attempt to open a receiver, and the longest wait: each further attempt waits twice as long.
const RETRY: Duration = Duration::from_millis(500);
const LONGEST_RETRY: Duration = Duration::from_secs(5);

/// How often a thread that waits looks whether it is to stop.
const GLANCE: Duration = Duration::from_millis(100);

/// How long closing waits for the thread: a line that hangs is left to the kernel.
const CLOSING: Duration = Duration::from_secs(2);

/// A satellite receiver and what is asked of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceiverSettings {
    /// Where it is read.
    pub source: ReceiverSource,
    /// How long after its moment a fix comes.
    pub latency: Duration,
}

/// A satellite receiver that is read until this is dropped. It is opened again whatever happens to it.
#[derive(Debug)]
pub struct Receiver {
    positions: Positions,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Receiver {
    /// Begins to read.
    ///
    /// # Errors
    /// The system's, when it gives no thread.
    pub fn open(settings: ReceiverSettings) -> io::Result<Self> {
        let positions = Positions::of_receiver(settings.source.to_string(), boot_id()?);
        let (stop, shown) = (Arc::new(AtomicBool::new(false)), positions.clone());
        let stopping = stop.clone();
        let name = std::thread::Builder::new().name("receiver".into());
        let thread = name.spawn(move || Reading { settings, positions: shown, stopping }.run())?;
        Ok(Self { positions, stop, thread })
    }

    /// Where the rig is, from now on and from anywhere.
    #[must_use]
    pub fn positions(&self) -> Positions {
        self.positions.clone()
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let deadline = Instant::now() + CLOSING;
        while !self.thread.is_finished() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// The thread's own.
struct Reading {
    settings: ReceiverSettings,
    positions: Positions,
    stopping: Arc<AtomicBool>,
}

impl Reading {
    fn run(&self) {
        let mut failures = 0;
        while !self.is_over() {
            let before = self.positions.health().map(|health| health.sentences);
            if let Err(error) = Port::open(&self.settings.source).and_then(|port| self.pump(port)) {
                self.positions.lost(&error);
            }
            let heard = self.positions.health().map(|health| health.sentences) != before;
            failures = if heard { 0 } else { failures + 1 };
            let until = Instant::now() + RETRY.saturating_mul(1 << failures.min(8)).min(LONGEST_RETRY);
            while !self.is_over() && Instant::now() < until {
                std::thread::sleep(GLANCE);
            }
        }
    }

    /// Reads until it is to stop.
    fn pump(&self, mut port: Port) -> io::Result<()> {
        let (mut lines, mut sentences) = (Lines::default(), Dialect::of(&self.settings.source));
        let mut buffer = [0; 4096];
        while !self.is_over() {
            if let Some(bytes) = port.read(&mut buffer)? {
                let latency = u64::try_from(self.settings.latency.as_nanos()).unwrap_or(u64::MAX);
                let moment = monotonic_ns().saturating_sub(latency);
                lines.feed(&buffer[..bytes], |line| {
                    self.positions.take(line.and_then(|line| sentences.read(line, moment)));
                });
            }
        }
        Ok(())
    }

    fn is_over(&self) -> bool {
        self.stopping.load(Ordering::Relaxed)
    }
}

/// What the receiver speaks.
#[derive(Debug)]
pub(super) enum Dialect {
    Nmea(Nmea),
    Gpsd,
}

impl Dialect {
    pub(super) fn of(source: &ReceiverSource) -> Self {
        match source {
            ReceiverSource::Gpsd(_) => Self::Gpsd,
            ReceiverSource::Nmea { .. } => Self::Nmea(Nmea::default()),
        }
    }

    pub(super) fn read(&mut self, line: &[u8], t_mono_ns: u64) -> Result<Option<Fix>, Fault> {
        match self {
            Self::Nmea(nmea) => nmea.read(line, t_mono_ns),
            Self::Gpsd => gpsd::read(line, t_mono_ns),
        }
    }
}
