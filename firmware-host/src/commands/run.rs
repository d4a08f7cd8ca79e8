//! `demeter run`: the daemon.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use metrics_exporter_prometheus::PrometheusBuilder;
use sd_notify::NotifyState;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};

use crate::api::{Activity, Api};
use crate::config::Config;
use crate::error::{CommandError, Exit};
use crate::output::Output;
use crate::store::Store;

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

/// Opens the store, serves the page until SIGTERM or Ctrl-C.
///
/// # Errors
/// [`CommandError`]: 2 for the configuration, 78 for a newer store, 1 where the address is taken.
pub fn run(args: &Args, _output: &Output) -> Result<Exit, CommandError> {
    let mut config = Config::load(args.config.as_deref())?;
    if let Some(path) = &args.db {
        config.store.path.clone_from(path);
    }
    let store = Store::open(&config.store.path)?;
    let runtime = tokio::runtime::Runtime::new().map_err(|error| CommandError::failed("runtime", &error))?;
    runtime.block_on(serve(&config, &store))
}

async fn serve(config: &Config, store: &Store) -> Result<Exit, CommandError> {
    let failed = |error: std::io::Error| CommandError {
        message: format!("{}: {error}", config.api.listen),
        ..CommandError::failed("listen", &error)
    };
    let listener = TcpListener::bind(config.api.listen).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let recorder = Arc::new(PrometheusBuilder::new().build_recorder());
    metrics::set_global_recorder(recorder.clone()).map_err(|error| CommandError::failed("metrics", &error))?;
    let activity = Activity::default();
    let api = Api::new(store.reader()?, activity, recorder, address);

    let mut terminate = signal(SignalKind::terminate()).map_err(failed)?;
    let stop = async move {
        tokio::select! {
            _ = terminate.recv() => {}
            // Without a handler for Ctrl-C there is SIGTERM still.
            result = tokio::signal::ctrl_c() => if let Err(error) = result { tracing::warn!("Ctrl-C: {error}") },
        }
        tracing::info!("stopping");
        notify(NotifyState::Stopping);
    };
    let watchdog = tokio::spawn(watchdog(api.clone()));
    notify(NotifyState::Ready);
    tracing::info!("store {}, page http://{address}", config.store.path.display());
    let result = api.serve(listener, stop).await;
    watchdog.abort();
    result.map_err(failed)?;
    Ok(Exit::Done)
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
