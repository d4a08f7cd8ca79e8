//! The daemon's pipeline: the configured source, run beside the page.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use demeter_capture::{Manifest, Pace, Replay, Source};
use demeter_frame::Intrinsics;
use demeter_recon::world::Row;

use crate::api::{Activity, State};
use crate::config::{ModelsConfig, SourceConfig};
use crate::error::CommandError;
use crate::eye::Eye;
use crate::files;
use crate::pipeline::{self, PipelineError, Progress, Run};
use crate::store::{Store, StoreError};
use crate::synthetic::Synthetic;

/// Size of synthetic pictures, pixels, and their horizontal field of view, radians: a plain webcam's.
const SYNTHETIC_CAMERA: (u32, u32, f64) = (640, 480, 0.733);
/// Frames that each synthetic plant is seen in, about.
const FRAMES_A_PLANT: usize = 4;
/// Metres between synthetic plants, and their age from 0 (seedling) to 1 (full height): as `demeter synth session`.
const SYNTHETIC_ROW: (f64, f64) = (0.35, 0.25);

/// Runs the source through these networks to its end, or until `stop` is set; `activity` says how it goes.
///
/// # Errors
/// Only the store's: without it nothing may be acknowledged, so the program must end. Everything else stands on the
/// page, where stored plants can still be seen.
pub fn work(
    source: &SourceConfig,
    models: &ModelsConfig,
    store: &Store,
    stop: &AtomicBool,
    activity: &Activity,
) -> Result<(), StoreError> {
    let state = match run(source, models, store, stop) {
        Ok(state) => state,
        Err(WorkError::Store(error)) => return Err(error),
        Err(WorkError::Other(error)) => State::Failed(error.message),
    };
    if let State::Failed(why) = &state {
        tracing::error!("the pipeline stopped: {why}");
    }
    activity.set(state);
    Ok(())
}

/// Who has to end.
enum WorkError {
    /// The program.
    Store(StoreError),
    /// The pipeline alone.
    Other(CommandError),
}

impl From<CommandError> for WorkError {
    fn from(error: CommandError) -> Self {
        Self::Other(error)
    }
}

fn run(source: &SourceConfig, models: &ModelsConfig, store: &Store, stop: &AtomicBool) -> Result<State, WorkError> {
    let (mut source, manifest) = match source {
        SourceConfig::Replay { session } => replay(session)?,
        SourceConfig::Synthetic { species, plants, seed } => synthetic(species, *plants, *seed)?,
    };
    let species = files::species(&manifest.species)?;
    // One thread for the network: the other core decodes and fits.
    let mut eye = Eye::open(models, NonZeroUsize::MIN).map_err(|error| CommandError::failed("network", &error))?;
    let run = Run { manifest: &manifest, species: &species, store, stop };
    let outcome = pipeline::run(&run, &mut *source, &mut eye, |progress| match progress {
        Progress::Frame => metrics::counter!("demeter_frames_total").increment(1),
        Progress::Plant(_) => metrics::counter!("demeter_plants_stored_total").increment(1),
    });
    match outcome {
        Ok(outcome) => Ok(outcome.ended.map_or(State::Finished, State::Failed)),
        Err(PipelineError::Store(error)) => Err(WorkError::Store(error)),
        Err(error @ PipelineError::Panicked { .. }) => Err(CommandError::failed("bug", &error).into()),
    }
}

fn replay(session: &Path) -> Result<(Box<dyn Source>, Manifest), CommandError> {
    let replay = Replay::open(session, Pace::Real).map_err(|error| CommandError::failed("session", &error))?;
    let manifest = replay.manifest().clone();
    Ok((Box::new(replay), manifest))
}

fn synthetic(name: &str, plants: u16, seed: u64) -> Result<(Box<dyn Source>, Manifest), CommandError> {
    let species = files::species(name)?;
    let (width, height, hfov) = SYNTHETIC_CAMERA;
    let (spacing, age) = SYNTHETIC_ROW;
    let plants = usize::from(plants);
    let plan = Row { plants, spacing, age, frames: FRAMES_A_PLANT * plants };
    let id = format!("synth-{name}-{seed}");
    let source = Synthetic::new(&species, &plan, Intrinsics::from_hfov(width, height, hfov), seed, id)
        .map_err(|error| CommandError::failed("world", &error))?;
    let manifest = source.manifest(name, &plan);
    Ok((Box::new(source), manifest))
}
