use std::num::{NonZeroU32, NonZeroUsize};
use std::path::Path;
use std::time::Instant;

use demeter_models::{Manifest, Model, ModelError, Runtime};
use demeter_recon::statistics::median;
use serde::Serialize;

use super::probe::Probe;
use crate::error::{CommandError, Exit, chain};
use crate::eye::EyeError;
use crate::output::Output;

/// Arguments of `demeter models bench`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The models; all when none is named.
    names: Vec<String>,
    /// Calls to time, after one that is not.
    #[arg(long, default_value = "10")]
    calls: NonZeroU32,
    /// Threads of each model.
    #[arg(long, default_value = "1")]
    threads: NonZeroUsize,
}

#[derive(Serialize)]
struct Timing {
    name: String,
    /// Middle of the calls.
    milliseconds: f64,
    /// Quickest of them.
    least: f64,
    provider: &'static str,
    threads: NonZeroUsize,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let runtime = Runtime::load(None).map_err(EyeError::from)?;
    let (mut timings, mut exit) = (Vec::new(), Exit::Done);
    if !output.json {
        output.text(&format!("{:<24} {:>9} {:>9}  {:<22} threads\n", "name", "ms", "least", "provider"))?;
    }
    for path in super::manifests(&args.names)? {
        match time(&runtime, &path, args) {
            Ok(timing) if output.json => timings.push(timing),
            Ok(Timing { name, milliseconds, least, provider, threads }) => {
                output.text(&format!("{name:<24} {milliseconds:>9.1} {least:>9.1}  {provider:<22} {threads}\n"))?;
            }
            Err(error) => {
                tracing::warn!("{}", chain(&error));
                exit = Exit::Partial;
            }
        }
    }
    if output.json {
        output.json(&serde_json::json!({"models": timings}))?;
    }
    Ok(exit)
}

fn time(runtime: &Runtime, path: &Path, args: &Args) -> Result<Timing, ModelError> {
    let mut probe = Probe::open(runtime, path, args.threads)?;
    probe.run()?;
    let mut call = || {
        let started = Instant::now();
        probe.run().map(|()| started.elapsed().as_secs_f64() * 1e3)
    };
    let times = (0..args.calls.get()).map(|_| call()).collect::<Result<Vec<_>, _>>()?;
    Ok(Timing {
        name: Manifest::read(path)?.name,
        least: times.iter().copied().fold(f64::INFINITY, f64::min),
        // There is at least one call.
        milliseconds: median(times).unwrap_or_default(),
        provider: Model::PROVIDER,
        threads: args.threads,
    })
}
