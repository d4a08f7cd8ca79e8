use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};
use tokio::sync::{Notify, oneshot};

use super::backoff::{Backoff, SHORTEST};
use super::brapi::Brapi;
use super::clock::SyncClock;
use super::destination::Destination;
use super::lock::Lock;
use super::pack::PLANTS_A_TABLE;
use super::pass::{Pass, PassError, Syncer};
use super::ways::watch;
use crate::clock::SystemClock;
use crate::config::{BrapiConfig, SyncConfig};
use crate::error::CommandError;
use crate::store::Store;

/// What the daemon's sync does, for the API; cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Attendant {
    inner: Arc<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    config: Mutex<SyncConfig>,
    report: Mutex<Report>,
    asked: Notify,
    appeared: Notify,
}

/// How the sync stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Where plants go, `None` where nothing is configured.
    pub destination: Option<String>,
    /// Passes asked for so far.
    pub asked: u64,
    /// The last pass that was asked for and has ended.
    pub ended: u64,
    /// When the last pass ended, RFC 3339 UTC.
    pub last: Option<String>,
    /// What it did.
    pub pass: Option<Pass>,
    /// When the next one is tried without being asked for, RFC 3339 UTC.
    pub next: Option<String>,
}

impl Attendant {
    /// Of a program with this configuration.
    #[must_use]
    pub fn new(config: &SyncConfig) -> Self {
        let attendant = Self::default();
        attendant.configure(config);
        attendant
    }

    /// Puts another configuration in force, from the next pass on.
    pub fn configure(&self, config: &SyncConfig) {
        self.config().clone_from(config);
        self.report_mut().destination.clone_from(&config.url);
    }

    /// Asks for a pass; its number. Passes asked for while one runs become one.
    pub fn ask(&self) -> u64 {
        let mut report = self.report_mut();
        report.asked += 1;
        self.inner.asked.notify_one();
        report.asked
    }

    /// Tells that a way to the destination has come: what waits is tried again now instead of later.
    pub fn appeared(&self) {
        self.inner.appeared.notify_one();
    }

    /// Where plants go.
    pub(super) fn destination(&self) -> Option<String> {
        self.config().url.clone()
    }

    /// What the store knows the BrAPI server by, where there is one.
    #[must_use]
    pub fn brapi(&self) -> Option<String> {
        self.config().brapi.as_ref().map(BrapiConfig::name)
    }

    /// How it stands.
    #[must_use]
    pub fn report(&self) -> Report {
        self.report_mut().clone()
    }

    fn config(&self) -> MutexGuard<'_, SyncConfig> {
        self.inner.config.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn report_mut(&self) -> MutexGuard<'_, Report> {
        self.inner.report.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The daemon's sync: waits to be asked or for a way to the destination, then passes until nothing waits, with growing
/// waits after failures. Never ends of its own; dropped in the middle of a pass it loses at most the object on its way.
///
/// # Errors
/// [`PassError`] when the store breaks.
pub async fn attend<C: SyncClock>(
    attendant: &Attendant,
    (store, path): (&Store, &Path),
    clock: &C,
) -> Result<(), PassError> {
    let mut backoff = Backoff::new(fastrand::u64(..));
    let Inner { asked: by_somebody, appeared, .. } = &*attendant.inner;
    loop {
        tokio::select! {
            () = by_somebody.notified() => {}
            () = appeared.notified() => {}
        }
        loop {
            let asked = attendant.report().asked;
            let config = attendant.config().clone();
            let pass = pass(&config, store, path, clock).await?;
            let done = pass.is_over() || config.url.is_none();
            if done || pass.brought() {
                backoff.succeeded();
            }
            let wait = (!done).then(|| backoff.failed());
            let now = clock.now();
            {
                let mut report = attendant.report_mut();
                report.ended = asked;
                report.last = Some(now.to_string());
                report.pass = Some(pass);
                report.next = wait.and_then(|wait| now.checked_add(wait).ok()).map(|time| time.to_string());
            }
            let Some(wait) = wait else { break };
            // However often ways come and go, a server that does not answer has its half minute.
            let rest = async {
                clock.sleep(SHORTEST).await;
                tokio::select! {
                    () = clock.sleep(wait.saturating_sub(SHORTEST)) => {}
                    () = appeared.notified() => {}
                }
            };
            tokio::select! {
                () = rest => {}
                () = by_somebody.notified() => {}
            }
        }
    }
}

/// Attends on a thread of its own, since packing and hashing must not hold up the page, until what it returns is
/// dropped; `broken` is told when the store breaks.
pub fn start(
    attendant: &Attendant,
    store: &Arc<Store>,
    path: &Path,
    clock: &Arc<SystemClock>,
    broken: impl FnOnce(CommandError) + Send + 'static,
) -> oneshot::Sender<()> {
    let (stop, stopped) = oneshot::channel();
    let (attendant, store, path, clock) = (attendant.clone(), store.clone(), path.to_owned(), clock.clone());
    std::thread::spawn(move || {
        // Nothing here is urgent: the line goes first. On Linux this is said of the calling thread alone.
        rustix::process::nice(10).ok();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let outcome = runtime.map_err(|error| CommandError::failed("runtime", &error)).and_then(|runtime| {
            runtime.block_on(async {
                tokio::select! {
                    _ = stopped => Ok(()),
                    never = watch(&attendant, Path::new("/"), &*clock) => never,
                    outcome = attend(&attendant, (&store, &path), &*clock) => outcome.map_err(CommandError::from),
                }
            })
        });
        if let Err(error) = outcome {
            broken(error);
        }
    });
    stop
}

/// One pass; the destination is opened anew each time, for a disk may have been mounted or a secret mended.
async fn pass<C: SyncClock>(config: &SyncConfig, store: &Store, path: &Path, clock: &C) -> Result<Pass, PassError> {
    match open(config, store, path, clock) {
        Ok((syncer, _lock)) => syncer.pass().await,
        Err(CommandError { message, .. }) => {
            tracing::warn!("sync: {message}");
            store.note_waiting(&message)?;
            Ok(Pass { left: store.reader()?.summary()?.unsent, failure: Some(message), ..Pass::default() })
        }
    }
}

/// A syncer with the right to sync.
pub(crate) fn open<'a, C: SyncClock>(
    config: &SyncConfig,
    store: &'a Store,
    path: &Path,
    clock: C,
) -> Result<(Syncer<'a, C>, Lock), CommandError> {
    let destination = destination(config)?;
    let brapi = config.brapi.as_ref().map(Brapi::open).transpose()?;
    let lock = Lock::take(path)?;
    let (reader, trusting) = (store.reader()?, config.trust_clock);
    let syncer = Syncer { store, reader, destination, brapi, clock, trusting, plants_a_table: PLANTS_A_TABLE };
    Ok((syncer, lock))
}

/// The destination, which has to be named.
pub(crate) fn destination(config: &SyncConfig) -> Result<Destination, CommandError> {
    let nowhere = || CommandError::usage("configuration", "configuration: `sync.url`: expected a place, found nothing");
    Destination::open(config)?.ok_or_else(nowhere)
}
