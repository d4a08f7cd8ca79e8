//! `demeter run`: the daemon.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use metrics_exporter_prometheus::PrometheusBuilder;
use tokio::net::TcpListener;

use crate::api::Api;
use crate::config::Config;
use crate::daemon::{Daemon, Load};
use crate::error::{CommandError, Exit};
use crate::output::Output;

/// How long reads of the store that are under way may keep the program at its end.
const LAST_READS: Duration = Duration::from_millis(200);

/// Arguments of `demeter run`.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// The configuration; without it /etc/demeter/demeter.toml where there is one, else the defaults.
    #[arg(long)]
    config: Option<PathBuf>,
    /// The store, instead of the configuration's.
    #[arg(long)]
    db: Option<PathBuf>,
}

impl Args {
    fn config(&self) -> Result<Config, CommandError> {
        let mut config = Config::load(self.config.as_deref())?;
        if let Some(path) = &self.db {
            config.store.path.clone_from(path);
        }
        Ok(config)
    }
}

/// Opens the store, serves the page and runs the configured source until SIGTERM, SIGINT (Ctrl-C) or SIGPWR.
///
/// # Errors
/// [`CommandError`]: 2 for the configuration, 78 for a newer store, 1 where the address is taken or the store breaks.
pub fn run(args: &Args, _output: &Output) -> Result<Exit, CommandError> {
    let args = args.clone();
    let load: Load = Box::new(move || args.config());
    let daemon = Daemon::open(load)?;
    let recorder = Arc::new(PrometheusBuilder::new().build_recorder());
    metrics::set_global_recorder(recorder.clone()).map_err(|error| CommandError::failed("metrics", &error))?;
    let runtime = tokio::runtime::Runtime::new().map_err(|error| CommandError::failed("runtime", &error))?;
    let end = runtime.block_on(async {
        let listen = daemon.config().api.listen;
        let listener = TcpListener::bind(listen).await.map_err(|error| refused(listen, &error))?;
        let address = listener.local_addr().map_err(|error| refused(listen, &error))?;
        let api = Api::new(daemon.reader()?, daemon.status(), daemon.views(), daemon.attendant(), recorder, address);
        tracing::info!("store {}, page http://{address}", daemon.config().store.path.display());
        daemon.run(api, listener).await
    });
    runtime.shutdown_timeout(LAST_READS);
    end
}

fn refused(listen: SocketAddr, error: &std::io::Error) -> CommandError {
    CommandError { message: format!("{listen}: {error}"), ..CommandError::failed("listen", error) }
}
