//! `demeter replay`: a recorded session through the pipeline into a store.

use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use demeter_capture::{Pace, Replay, Source};
use indicatif::{ProgressBar, ProgressStyle};

use crate::clock::SystemClock;
use crate::config::Config;
use crate::error::{CommandError, Exit};
use crate::eye::Eye;
use crate::files;
use crate::output::Output;
use crate::pipeline::{self, Control, Outcome, Progress, Run};
use crate::report::Document;
use crate::store::Store;

/// Arguments of `demeter replay`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The session's folder.
    session: PathBuf,
    /// The store that plants go into; made when it is not there.
    #[arg(long, default_value = "demeter.sqlite")]
    db: PathBuf,
    /// The configuration, whose `[models]` names the networks; without it /etc/demeter/demeter.toml where there is one.
    #[arg(long)]
    config: Option<PathBuf>,
    /// As fast as it goes, or as it was recorded.
    #[arg(long, value_enum, default_value_t = Speed::Max)]
    speed: Speed,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Speed {
    Max,
    Real,
}

/// Replays a session; frames or plants that were lost on the way make the answer partial (exit 3).
///
/// # Errors
/// [`CommandError`] for a session that cannot be opened, an unknown species, a missing network, a store that fails.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let pace = match args.speed {
        Speed::Max => Pace::Max,
        Speed::Real => Pace::Real,
    };
    let mut source = Replay::open(&args.session, pace).map_err(|error| CommandError::failed("session", &error))?;
    let manifest = source.manifest().clone();
    let species = files::species(&manifest.species)?;
    // One thread for the network: the other core decodes and fits.
    let mut eye = Eye::open(&Config::load(args.config.as_deref())?.models, NonZeroUsize::MIN)?;
    let store = Store::open(&args.db)?;
    let bar = progress_bar(source.len_hint());
    let (control, clock) = (Control::default(), SystemClock::new());
    let run =
        Run { manifest: &manifest, species: &species, store: &store, control: &control, clock: &clock, live: false };
    control.show_positions(source.positions());
    let mut plants = Vec::new();
    let outcome = pipeline::run(&run, &mut source, &mut eye, |progress| match progress {
        Progress::Frame => bar.inc(1),
        Progress::Plant(plant) => {
            bar.set_message(plant.id.clone().unwrap_or_default());
            plants.push(plant.clone());
        }
    });
    bar.finish_and_clear();
    let outcome = outcome.map_err(|error| match error {
        pipeline::PipelineError::Store(error) => error.into(),
        error @ (pipeline::PipelineError::Panicked { .. } | pipeline::PipelineError::Camera(_)) => {
            CommandError::failed("bug", &error)
        }
    })?;
    let exit = if outcome.is_partial() { Exit::Partial } else { Exit::Done };
    let losses = losses(&outcome);
    if !output.json {
        output.text(&summary(&outcome, &losses))?;
    }
    let warnings = if output.json { losses } else { Vec::new() };
    output.plants(&Document { plants, warnings, seconds: Some(outcome.seconds) })?;
    Ok(exit)
}

/// A bar on standard error; indicatif hides it when that is no terminal.
fn progress_bar(frames: Option<u64>) -> ProgressBar {
    let bar = frames.map_or_else(ProgressBar::no_length, ProgressBar::new);
    // The template is ours and sound; without it the bar is merely plainer.
    if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} frames  {per_sec}  {msg}") {
        bar.set_style(style);
    }
    bar
}

/// One line for each reason something was lost.
fn losses(outcome: &Outcome) -> Vec<String> {
    let gate = outcome.gate.refused.iter().map(|(reason, n)| format!("{n} frames refused: {reason}"));
    let unseen = outcome.unseen.iter().map(|(reason, n)| format!("{n} frames not understood: {reason}"));
    let lost = outcome.lost.iter().map(|(reason, n)| format!("{n} plants lost: {reason}"));
    let ended = outcome.ended.iter().map(|why| format!("the recording ended early: {why}"));
    gate.chain(unseen).chain(lost).chain(ended).collect()
}

fn summary(outcome: &Outcome, losses: &[String]) -> String {
    let (frames, seconds) = (outcome.frames, outcome.seconds);
    let mut text = format!(
        "{frames} frames, {} plants in {seconds:.1} s: {:.1} frames/s\n",
        outcome.plants,
        frames as f64 / seconds.max(1e-9)
    );
    for line in losses {
        // Writing to a String cannot fail.
        writeln!(text, "{line}").unwrap_or_default();
    }
    text
}
