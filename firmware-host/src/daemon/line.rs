//! The line from frames to plants: the configured source, run in threads of its own.

use std::io;
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use demeter_capture::{Cameras, Manifest, Pace, Receiver, Replay, Source, Speed};
use demeter_frame::Intrinsics;
use demeter_recon::world::Row;

use crate::clock::{Clock, SystemClock};
use crate::config::camera::{self, CameraConfig, Sown};
use crate::config::{ModelsConfig, PositionConfig, SourceConfig};
use crate::error::CommandError;
use crate::eye::Eye;
use crate::files;
use crate::pipeline::{self, Control, PipelineError, Progress, Run};
use crate::status::Activity;
use crate::store::{Store, StoreError};
use crate::synthetic::Synthetic;

/// Size of synthetic pictures, pixels, and their horizontal field of view, radians: a plain webcam's.
const SYNTHETIC_CAMERA: (u32, u32, f64) = (640, 480, 0.733);
/// Frames that each synthetic plant is seen in, about.
const FRAMES_A_PLANT: usize = 4;
/// Metres between synthetic plants, and their age from 0 (seedling) to 1 (full height): as `demeter synth session`.
const SYNTHETIC_ROW: (f64, f64) = (0.35, 0.25);

/// What to run, and where plants go.
#[derive(Debug)]
pub(super) struct Line {
    pub(super) source: SourceConfig,
    /// The rig's cameras.
    pub(super) cameras: Vec<CameraConfig>,
    pub(super) models: ModelsConfig,
    pub(super) position: PositionConfig,
    pub(super) store: Arc<Store>,
    pub(super) clock: Arc<SystemClock>,
    /// The box's name.
    pub(super) rig: String,
}

/// How it ended.
#[derive(Debug)]
pub(super) enum End {
    /// The pipeline alone: the page says why, and shows stored plants.
    Line(Activity),
    /// The store failed: without it nothing may be acknowledged, so the program has to end.
    Store(StoreError),
    /// A stage panicked. What else that broke is not known, so the program has to end.
    Bug(CommandError),
}

impl From<CommandError> for End {
    fn from(error: CommandError) -> Self {
        Self::Line(Activity::Failed(error.message))
    }
}

impl Line {
    /// Runs until the source ends or `control` says stop, in a thread that nobody waits for: one that hangs must not
    /// keep the program. `ended` is told how it went.
    pub(super) fn start(self, control: Arc<Control>, ended: impl FnOnce(End) + Send + 'static) {
        std::thread::spawn(move || {
            let end = catch_unwind(AssertUnwindSafe(|| self.run(&control)));
            // The last stage runs in this thread.
            let end = end.unwrap_or_else(|_panic| Err(bug(&PipelineError::Panicked { stage: "keeper" })));
            ended(end.map_or_else(|end| end, End::Line));
        });
    }

    fn run(&self, control: &Control) -> Result<Activity, End> {
        let failed = |error: io::Error| CommandError::failed("position", &error);
        let live = matches!(self.source, SourceConfig::Cameras { .. });
        // Read until the line ends. A recording brings its own positions, made-up plants have none.
        let receiver = self.position.receiver().filter(|_| live).map(Receiver::open).transpose().map_err(failed)?;
        if let Some(receiver) = &receiver {
            control.show_positions(receiver.positions());
        }
        let (mut source, manifest) = match &self.source {
            SourceConfig::Replay { session } => replay(session, control)?,
            SourceConfig::Synthetic { species, plants, seed } => self.synthetic(species, *plants, *seed)?,
            SourceConfig::Cameras { species, speed_m_per_s, spacing_m } => {
                let sown = Sown { species, spacing: *spacing_m, arm: self.position.arm() };
                // The configuration was refused where nobody tells the speed.
                let speed = self.position.speed(*speed_m_per_s).unwrap_or(Speed::Given(0.0));
                self.live(sown, speed, control)?
            }
        };
        let species = files::species(&manifest.species)?;
        let loading = control.looker.work();
        // One thread for the network: the other core decodes and fits.
        let mut eye = Eye::open(&self.models, NonZeroUsize::MIN).map_err(CommandError::from)?;
        drop(loading);
        let (store, clock) = (&*self.store, &*self.clock);
        let run = Run { manifest: &manifest, species: &species, store, control, clock, live };
        let outcome = pipeline::run(&run, &mut *source, &mut eye, |progress| match progress {
            Progress::Frame => metrics::counter!("demeter_frames_total").increment(1),
            Progress::Plant(_) => metrics::counter!("demeter_plants_stored_total").increment(1),
        });
        match outcome {
            Ok(outcome) => Ok(outcome.ended.map_or(Activity::Finished, Activity::Failed)),
            Err(PipelineError::Store(error)) => Err(End::Store(error)),
            Err(error @ (PipelineError::Panicked { .. } | PipelineError::Camera(_))) => Err(bug(&error)),
        }
    }

    /// The name of a session that begins now. It needs no wall clock: two boots differ, and within one time goes on.
    fn session_id(&self) -> String {
        let boot = self.clock.boot_id().get(..8).unwrap_or("unknown");
        format!("{}-{boot}-{}", self.rig, self.clock.now().mono_ns / 1_000_000)
    }

    fn live(
        &self,
        sown: Sown<'_>,
        speed: Speed,
        control: &Control,
    ) -> Result<(Box<dyn Source>, Manifest), CommandError> {
        let settings: Vec<_> = self.cameras.iter().map(|camera| camera.settings(speed)).collect::<Result<_, _>>()?;
        let cameras =
            Cameras::open(&settings, &control.positions()).map_err(|error| CommandError::failed("camera", &error))?;
        control.show_cameras(cameras.health());
        Ok((Box::new(cameras), camera::manifest(&self.cameras, sown, &self.rig, &self.session_id())?))
    }

    fn synthetic(&self, name: &str, plants: u16, seed: u64) -> Result<(Box<dyn Source>, Manifest), CommandError> {
        let species = files::species(name)?;
        let (width, height, hfov) = SYNTHETIC_CAMERA;
        let (spacing, age) = SYNTHETIC_ROW;
        let plants = usize::from(plants);
        let plan = Row { plants, spacing, age, frames: FRAMES_A_PLANT * plants };
        let camera = Intrinsics::from_hfov(width, height, hfov);
        let source = Synthetic::new(&species, &plan, camera, seed, self.session_id())
            .map_err(|error| CommandError::failed("world", &error))?;
        let manifest = Manifest { rig_id: self.rig.clone(), ..source.manifest(name, &plan) };
        Ok((Box::new(source), manifest))
    }
}

fn bug(error: &PipelineError) -> End {
    End::Bug(CommandError::failed("bug", error))
}

fn replay(session: &Path, control: &Control) -> Result<(Box<dyn Source>, Manifest), CommandError> {
    let replay = Replay::open(session, Pace::Real).map_err(|error| CommandError::failed("session", &error))?;
    control.show_positions(replay.positions());
    let manifest = replay.manifest().clone();
    Ok((Box::new(replay), manifest))
}
