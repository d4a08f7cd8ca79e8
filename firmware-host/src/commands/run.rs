//! `demeter run`: the daemon.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::ScopedJoinHandle;
use std::time::Duration;

use metrics_exporter_prometheus::PrometheusBuilder;
use sd_notify::NotifyState;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::Notify;

use crate::api::{Activity, Api, State};
use crate::config::Config;
use crate::error::{CommandError, Exit};
use crate::output::Output;
use crate::store::Store;
use crate::worker;

/// Arguments of `demeter run`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The configuration; without it /etc/demeter/demeter.toml where there is one, else the defaults.
    #[arg(long)]
    config: Option<PathBuf>,
    /// The store, instead of the configuration's.
    #[arg(long)]
    db: Option<PathBuf>,
}

/// Opens the store, serves the page and runs the configured source until SIGTERM or Ctrl-C.
///
/// # Errors
/// [`CommandError`]: 2 for the configuration, 78 for a newer store, 1 where the address is taken.
pub fn run(args: &Args, _output: &Output) -> Result<Exit, CommandError> {
    let mut config = Config::load(args.config.as_deref())?;
    if let Some(path) = &args.db {
        config.store.path.clone_from(path);
    }
    let store = Store::open(&config.store.path)?;
    let activity = Activity::default();
    let recorder = Arc::new(PrometheusBuilder::new().build_recorder());
    metrics::set_global_recorder(recorder.clone()).map_err(|error| CommandError::failed("metrics", &error))?;
    let runtime = tokio::runtime::Runtime::new().map_err(|error| CommandError::failed("runtime", &error))?;
    let listen = config.api.listen;
    let listener = runtime.block_on(TcpListener::bind(listen)).map_err(|error| refused(listen, &error))?;
    let address = listener.local_addr().map_err(|error| refused(listen, &error))?;
    let api = Api::new(store.reader()?, activity.clone(), recorder, address);

    let (stop, broken) = (AtomicBool::new(false), Notify::new());
    std::thread::scope(|scope| {
        let worker = config.source.as_ref().map(|source| {
            // Before the first answer, so that nobody is told that there is no source.
            activity.set(State::Working);
            let work =
                || worker::work(source, &config.models, &store, &stop, &activity).inspect_err(|_| broken.notify_one());
            scope.spawn(work)
        });
        tracing::info!("store {}, page http://{address}", config.store.path.display());
        let served = runtime.block_on(serve(api, listener, &broken)).map_err(|error| refused(listen, &error));
        stop.store(true, Ordering::Relaxed);
        let worked = worker.map_or(Ok(Ok(())), ScopedJoinHandle::join);
        worked.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        served?;
        Ok(Exit::Done)
    })
}

fn refused(listen: SocketAddr, error: &std::io::Error) -> CommandError {
    CommandError { message: format!("{listen}: {error}"), ..CommandError::failed("listen", error) }
}

/// Serves until SIGTERM, Ctrl-C or a store that is broken.
async fn serve(api: Api, listener: TcpListener, broken: &Notify) -> std::io::Result<()> {
    let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
    let stop = async {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
            () = broken.notified() => {}
        }
        tracing::info!("stopping");
        notify(NotifyState::Stopping);
    };
    let watchdog = tokio::spawn(watchdog(api.clone()));
    notify(NotifyState::Ready);
    let result = api.serve(listener, stop).await;
    watchdog.abort();
    result
}

/// Tells systemd that the program is alive, as often as the unit asks and only while the store answers.
async fn watchdog(api: Api) {
    let Some(limit) = sd_notify::watchdog_enabled() else { return };
    // Half the limit, so that one late ping is not taken for a freeze.
    let mut ticks = tokio::time::interval((limit / 2).max(Duration::from_millis(100)));
    loop {
        ticks.tick().await;
        if api.alive().await {
            notify(NotifyState::Watchdog);
        }
    }
}

fn notify(state: NotifyState<'_>) {
    // Outside systemd there is nobody to tell, which is no error.
    if let Err(error) = sd_notify::notify(&[state]) {
        tracing::warn!("systemd: {error}");
    }
}
