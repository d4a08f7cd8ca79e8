//! The daemon: one loop that owns what is known, and threads that do the work.
//!
//! ```text
//! signals ─┐
//! ticks ───┼─► Events::next ─► Daemon::apply ─► Status ─► page, API, lamp, watchdog
//! threads ─┘                        │
//!                                   └─► Control ─► pipeline (its own threads)
//! ```
//!
//! `apply` never waits, so a frozen stage or a disk that hangs is seen and told. What may block (the store, the clock's
//! question to systemd, the line itself) runs elsewhere and sends an [`Event`] when it is done.

pub mod disk;
mod event;
pub mod lamp;
mod line;
mod look;
pub mod rig;
pub mod thermal;
pub mod watchdog;

use std::ops::ControlFlow::{self, Break, Continue};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use sd_notify::NotifyState;
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::mpsc::Sender;
use tokio::sync::{oneshot, watch};

use crate::api::Api;
use crate::clock::{Clock, SystemClock};
use crate::config::Config;
use crate::error::{CommandError, Exit, chain};
use crate::pipeline::{Control, Views};
use crate::status::{Activity, Status};
use crate::store::{Reader, Store, StoreError};
use crate::sync::{self, Attendant};
use disk::{Disk, folder_of};
use event::{Event, Events};
use lamp::{Lamp, STEP};
use line::{End, Line};
use rig::{Named, Rig};
use thermal::Thermal;
use watchdog::StoreBeat;

/// How long the line may finish what it has in hand after a stop, and when it is left to itself. With what follows (the
/// page's last answers, the store's log into its file) the program ends within 5 s, which a power supply has to last.
const GRACE: Duration = Duration::from_secs(3);
const GIVE_UP: Duration = Duration::from_secs(4);

/// How long the page's last answers may take.
const LAST_ANSWERS: Duration = Duration::from_millis(500);

/// Gives the configuration as it stands in its file now.
pub type Load = Box<dyn Fn() -> Result<Config, CommandError> + Send>;

/// Everything that is known.
pub struct Daemon {
    load: Load,
    config: Config,
    store: Arc<Store>,
    clock: Arc<SystemClock>,
    /// The line that runs; none before its start and after its end.
    line: Option<Arc<Control>>,
    /// What the cameras of the last line saw.
    views: Views,
    thermal: Thermal,
    disk: Disk,
    lamp: Lamp,
    store_beat: StoreBeat,
    attendant: Attendant,
    /// Why the newest configuration is not in force.
    refused: Option<String>,
    /// Why an output of the lamp cannot be written.
    dark: Option<String>,
    /// The line is to be started anew, with another configuration, once it has ended.
    renew: bool,
    /// When the line is left to itself; unset until the program is told to stop.
    give_up: Option<Instant>,
    steps: u32,
    status: watch::Sender<Status>,
}

/// Whom the loop talks to.
struct Links {
    api: Api,
    /// Tells the API to end, once.
    close: Option<oneshot::Sender<()>>,
    /// Brings events from threads and tasks.
    news: Sender<Event>,
}

impl Daemon {
    /// Opens the store and finds out which box this is.
    ///
    /// # Errors
    /// [`CommandError`]: 2 for the configuration, 78 for a newer store, 1 for a folder that cannot be written.
    pub fn open(load: Load) -> Result<Self, CommandError> {
        let config = load()?;
        let path = &config.store.path;
        let mut disk = Disk::new(path, config.store.min_free_bytes());
        // A store on a full disk cannot even be opened without its reserve.
        let room = disk.update(false);
        if disk.change(&room, false) == Some(false) {
            disk.reserve().hold(false).unwrap_or_else(|error| tracing::warn!("the store's reserve: {error}"));
        }
        let store = Arc::new(Store::open(path)?);
        let clock = Arc::new(SystemClock::new());
        let (rig, named) = Rig::identify(Path::new("/"), &folder_of(path).join("rig.json"))?;
        if let Named::Cloned { from } = named {
            tracing::warn!("this disk was cloned from {from}; this box is {}", rig.id);
            store.save_event(clock.now().wall, "rig_cloned", &json!({"from": from, "rig": rig.id}))?;
        }
        Ok(Self {
            thermal: Thermal::new(config.thermal.clone()),
            disk,
            lamp: Lamp::new(&config.lamp),
            attendant: Attendant::new(&config.sync),
            load,
            config,
            store,
            clock,
            line: None,
            views: Views::default(),
            store_beat: StoreBeat::new(Instant::now()),
            refused: None,
            dark: None,
            renew: false,
            give_up: None,
            steps: 0,
            status: watch::Sender::new(Status { rig: rig.id, ..Status::default() }),
        })
    }

    /// What is in force.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the daemon says about itself, now and later.
    #[must_use]
    pub fn status(&self) -> watch::Receiver<Status> {
        self.status.subscribe()
    }

    /// What the cameras see, now and later.
    #[must_use]
    pub fn views(&self) -> Views {
        self.views.clone()
    }

    /// Whom to ask for a sync.
    #[must_use]
    pub fn attendant(&self) -> Attendant {
        self.attendant.clone()
    }

    /// A reader of the store.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be opened a second time.
    pub fn reader(&self) -> Result<Reader, StoreError> {
        self.store.reader()
    }

    /// Serves the page and runs the configured source until it is told to stop.
    ///
    /// # Errors
    /// [`CommandError`] (exit 1) when the store or the page broke, or a stage panicked.
    pub async fn run(mut self, api: Api, listener: TcpListener) -> Result<Exit, CommandError> {
        let failed = |error: std::io::Error| CommandError::failed("signals", &error);
        let (mut events, news) = Events::new(STEP).map_err(failed)?;
        let (close, closed) = oneshot::channel();
        let mut links = Links { api: api.clone(), close: Some(close), news: news.clone() };
        // Before the first answer, so that nobody is told that there is no source.
        self.start_line(&links);
        let broken = links.news.clone();
        let syncing = sync::start(&self.attendant, &self.store, &self.config.store.path, &self.clock, move |error| {
            broken.blocking_send(Event::SyncBroke(error)).unwrap_or_default();
        });
        let server = tokio::spawn(async move {
            let result = api.serve(listener, async { closed.await.unwrap_or_default() }).await;
            // When nobody listens any more the program is ending.
            news.send(Event::ApiEnded(result)).await.unwrap_or_default();
        });
        notify(&[NotifyState::Ready]);
        let end = loop {
            let event = events.next().await;
            if let Break(end) = self.apply(event, &mut links) {
                break end;
            }
        };
        drop((links, syncing));
        // Clients that do not read their answer lose it.
        tokio::time::timeout(LAST_ANSWERS, server).await.ok();
        self.lamp.dark().unwrap_or_else(|error| tracing::warn!("{error}"));
        // A log that stays beside the store is no loss: the next start reads it.
        self.store.settle().unwrap_or_else(|error| tracing::warn!("{}", chain(&error)));
        end
    }

    /// Takes one event in; breaks when the program is to end.
    fn apply(&mut self, event: Event, links: &mut Links) -> ControlFlow<Result<Exit, CommandError>> {
        match event {
            Event::Tick => return self.tick(links),
            Event::Stop(why) => return self.stop(why, links),
            Event::Reload => self.reload(links),
            Event::StoreAnswered(well) => self.store_beat.answer(well, Instant::now()),
            Event::LineEnded(End::Line(activity)) => return self.line_ended(activity, links),
            Event::LineEnded(End::Store(error)) => return Break(Err(error.into())),
            Event::LineEnded(End::Bug(error)) | Event::SyncBroke(error) => return Break(Err(error)),
            Event::ApiEnded(result) if self.give_up.is_none() => {
                let error = result.err().unwrap_or_else(|| std::io::ErrorKind::ConnectionAborted.into());
                return Break(Err(CommandError::failed("api", &error)));
            }
            Event::ApiEnded(_) => {}
        }
        Continue(())
    }

    fn start_line(&mut self, links: &Links) {
        let Some(source) = self.config.source.clone() else {
            self.set_activity(Activity::Idle);
            return;
        };
        let line = Line {
            source,
            cameras: self.config.cameras.clone(),
            models: self.config.models.clone(),
            position: self.config.position.clone(),
            store: self.store.clone(),
            clock: self.clock.clone(),
            rig: self.status.borrow().rig.clone(),
        };
        self.views.clear();
        let (control, news) = (Arc::new(Control::showing(self.views.clone())), links.news.clone());
        self.set_activity(Activity::Working);
        line.start(control.clone(), move |end| news.blocking_send(Event::LineEnded(end)).unwrap_or_default());
        self.line = Some(control);
    }

    fn line_ended(&mut self, activity: Activity, links: &Links) -> ControlFlow<Result<Exit, CommandError>> {
        self.line = None;
        if self.give_up.is_some() {
            return Break(Ok(Exit::Done));
        }
        if let Activity::Failed(why) = &activity {
            tracing::error!("the pipeline stopped: {why}");
        }
        self.set_activity(activity);
        if std::mem::take(&mut self.renew) {
            self.start_line(links);
        }
        Continue(())
    }

    fn stop(&mut self, why: &str, links: &mut Links) -> ControlFlow<Result<Exit, CommandError>> {
        if self.give_up.is_none() {
            tracing::info!("stopping: {why}");
            notify(&[NotifyState::Stopping]);
            self.give_up = Some(Instant::now() + GIVE_UP);
            // The sender that is dropped ends the API.
            links.close = None;
        }
        match &self.line {
            Some(control) => control.stop(GRACE),
            None => return Break(Ok(Exit::Done)),
        }
        Continue(())
    }

    fn reload(&mut self, links: &Links) {
        notify(&[NotifyState::Reloading]);
        match (self.load)() {
            Ok(config) => self.take(config, links),
            Err(error) => {
                tracing::error!("the configuration stays as it was: {}", error.message);
                self.note("configuration_refused", json!({"message": error.message}));
                self.refused = Some(error.message);
            }
        }
        notify(&[NotifyState::Ready]);
    }

    /// Puts another configuration in force.
    fn take(&mut self, config: Config, links: &Links) {
        let fixed = |config: &Config| (config.store.path.clone(), config.api.clone());
        self.refused = (fixed(&config) != fixed(&self.config))
            .then(|| "store.path and api.listen are taken at the next start: restart the service".into());
        self.thermal.configure(config.thermal.clone());
        self.disk.configure(config.store.min_free_bytes());
        self.attendant.configure(&config.sync);
        self.lamp.dark().unwrap_or_else(|error| tracing::warn!("{error}"));
        self.lamp = Lamp::new(&config.lamp);
        let line = |config: &Config| {
            (config.source.clone(), config.models.clone(), config.cameras.clone(), config.position.clone())
        };
        let other_line = line(&config) != line(&self.config);
        self.config = config;
        tracing::info!("the configuration was read again");
        self.note("configuration_taken", json!({}));
        match &self.line {
            Some(control) if other_line => {
                control.stop(GRACE);
                self.renew = true;
            }
            None if other_line => self.start_line(links),
            _ => {}
        }
    }

    fn set_activity(&self, activity: Activity) {
        self.status.send_modify(|status| status.activity = activity);
    }

    /// Notes what happened in the store, without waiting for it.
    fn note(&self, kind: &'static str, detail: Value) {
        let (store, now) = (self.store.clone(), self.clock.now().wall);
        let save =
            move || store.save_event(now, kind, &detail).unwrap_or_else(|error| tracing::warn!("{}", chain(&error)));
        tokio::task::spawn_blocking(save);
    }
}

fn notify(states: &[NotifyState<'_>]) {
    // Outside systemd there is nobody to tell, which is no error.
    if let Err(error) = sd_notify::notify(states) {
        tracing::warn!("systemd: {error}");
    }
}
