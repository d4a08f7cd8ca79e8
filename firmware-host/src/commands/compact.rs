//! `demeter compact`: merges the daily files of whole months where the plants went.

use std::path::PathBuf;

use crate::clock::SystemClock;
use crate::config::Config;
use crate::error::{CommandError, Exit};
use crate::output::Output;
use crate::report::columns;
use crate::sync::{Compacted, Month, NO_TIME, SyncClock, compact, destination};

/// Arguments of `demeter compact`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The configuration; without it /etc/demeter/demeter.toml where there is one, else the defaults.
    #[arg(long)]
    config: Option<PathBuf>,
}

/// Compacts the destination of the configuration.
///
/// # Errors
/// [`CommandError`]: 2 for the configuration, 1 for the server and where the clock is not synchronised.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let config = Config::load(args.config.as_deref())?;
    let destination = destination(&config.sync)?;
    let clock = SystemClock::new();
    if !config.sync.trust_clock && !clock.trusted() {
        return Err(CommandError { exit: Exit::Failed, ..CommandError::usage("clock", format!("compact: {NO_TIME}")) });
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| CommandError::failed("runtime", &error))?;
    let today = clock.now().to_zoned(jiff::tz::TimeZone::UTC).date();
    let done = runtime.block_on(compact(&destination, today))?;
    for file in &done.left_out {
        tracing::warn!("left out: {}", file.reason);
    }
    told(&done, output)?;
    Ok(if done.left_out.is_empty() { Exit::Done } else { Exit::Partial })
}

fn told(done: &Compacted, output: &Output) -> Result<(), CommandError> {
    if output.json {
        return output.json(done);
    }
    if done.months.is_empty() {
        return output.text("no month that is over has plants\n");
    }
    let row = |Month { manifest, written }: &Month| {
        let count = |of: fn(&crate::sync::Merged) -> usize| (of(&manifest.plants) + of(&manifest.organs)).to_string();
        [
            manifest.month.clone(),
            if *written { "merged" } else { "as before" }.to_owned(),
            manifest.plants.rows.to_string(),
            manifest.organs.rows.to_string(),
            count(|merged| merged.sources.len()),
            count(|merged| merged.files.len()),
        ]
    };
    let rows: Vec<_> = done.months.iter().map(row).collect();
    output.text(&columns(&["month", "", "plants", "organs", "daily files", "files"], &rows, output.color))
}
