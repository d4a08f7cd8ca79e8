//! `demeter sync`: sends what waits, or tells what waits and why.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::clock::SystemClock;
use crate::config::{BrapiConfig, Config};
use crate::error::{CommandError, Exit};
use crate::output::Output;
use crate::report::columns;
use crate::store::{Outbox, Reader, Store};
use crate::sync::{Backoff, Pass, ask, open, until_done};

/// Most plants that `--status` names.
const NAMED: u32 = 1000;

/// Arguments of `demeter sync`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Send what waits: the running daemon is asked to, without one this program does it.
    #[arg(long, conflicts_with = "status")]
    now: bool,
    /// Tell what waits and why; this is also what happens without either.
    #[arg(long)]
    status: bool,
    /// The configuration; without it /etc/demeter/demeter.toml where there is one, else the defaults.
    #[arg(long)]
    config: Option<PathBuf>,
    /// The store, instead of the configuration's; the daemon is not asked then.
    #[arg(long)]
    db: Option<PathBuf>,
}

/// Syncs or tells how the sync stands.
///
/// # Errors
/// [`CommandError`]: 2 for the configuration, 1 where another program syncs or the store breaks.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let config = Config::load(args.config.as_deref())?;
    let path = args.db.as_deref().unwrap_or(&config.store.path);
    if !args.now {
        return status(&Reader::open(path)?, &config, output);
    }
    // Its requests and waits need one thread.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| CommandError::failed("runtime", &error))?;
    let pass = runtime.block_on(async {
        if args.db.is_none()
            && let Some(report) = ask(config.api.listen).await?
        {
            return Ok(report.pass.unwrap_or_default());
        }
        alone(&config, path).await
    })?;
    told(&pass, output)
}

/// Without a daemon.
async fn alone(config: &Config, path: &Path) -> Result<Pass, CommandError> {
    // Opening would make an empty store where there is none.
    drop(Reader::open(path)?);
    let store = Store::open(path)?;
    let (syncer, _lock) = open(&config.sync, &store, path, SystemClock::new())?;
    Ok(until_done(&syncer, &mut Backoff::new(fastrand::u64(..))).await?)
}

fn told(pass: &Pass, output: &Output) -> Result<Exit, CommandError> {
    if output.json {
        output.json(pass)?;
    } else {
        let why = pass.failure.as_ref().map_or_else(String::new, |failure| format!(" ({failure})"));
        let brapi = match (pass.observed, pass.unobserved) {
            (0, 0) => String::new(),
            (sent, wait) => format!("; BrAPI: {sent} sent, {wait} wait"),
        };
        output.text(&format!("{} plants sent, {} wait{brapi}{why}\n", pass.sent, pass.left))?;
    }
    // What waits is safe and goes another night: no failure, even where nothing was sent.
    Ok(if pass.is_over() { Exit::Done } else { Exit::Partial })
}

fn status(reader: &Reader, config: &Config, output: &Output) -> Result<Exit, CommandError> {
    let outbox = reader.outbox(NAMED)?;
    let brapi = config.sync.brapi.as_ref().map(BrapiConfig::name);
    let units = brapi.as_ref().map(|name| reader.units(name, NAMED)).transpose()?;
    if output.json {
        output.json(&json!({"destination": config.sync.url, "outbox": outbox, "brapi": units}))?;
        return Ok(Exit::Done);
    }
    waiting(config.sync.url.as_deref().unwrap_or("nowhere, `sync.url` is not set"), &outbox, output)?;
    if let (Some(name), Some(units)) = (brapi, units) {
        waiting(&name, &units, output)?;
    }
    Ok(Exit::Done)
}

fn waiting(place: &str, outbox: &Outbox, output: &Output) -> Result<(), CommandError> {
    let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".into());
    output.text(&format!(
        "to {place}: {} plants wait, {} have left (the last at {})\n",
        outbox.waiting,
        outbox.sent,
        or_dash(&outbox.last_sent)
    ))?;
    let rows = outbox.plants.iter();
    let rows: Vec<_> = rows
        .map(|plant| {
            let reason = plant.reason.clone().unwrap_or_else(|| "not tried yet".into());
            [plant.id.clone(), reason, plant.attempts.to_string(), or_dash(&plant.last_try)]
        })
        .collect();
    if rows.is_empty() {
        return Ok(());
    }
    output.text(&columns(&["plant", "reason", "tries", "last try"], &rows, output.color))
}
