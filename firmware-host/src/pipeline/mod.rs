//! Frames to stored plants (spec/appliance.md "Data path").
//!
//! ```text
//! reader: Source ─► gate ──┐ 4 frames          looker: network ─► lift ─► track ──┐ 8 plants       caller: fit ─► store
//!                          └──────────────────►                                   └──────────────►
//! ```
//!
//! Three threads and two bounded queues: whoever is slow makes the one before wait, so a recording is never thinned out.
//! Only cameras cannot wait: their frames are dropped before the first queue, and counted. [`Control`] is how the daemon
//! watches the stages, slows them down and ends them.
//! Each stage works in the order of the frames, so what is stored does not depend on which thread ran when.

mod beat;
mod control;
mod keep;
mod looker;
mod place;
mod reader;
mod views;

use std::collections::BTreeMap;
use std::sync::mpsc::sync_channel;
use std::time::Instant;

use demeter_capture::{Counts, Manifest, Source};
use demeter_frame::CameraError;
use demeter_recon::model::Species;
use serde::Serialize;

pub use beat::{Beat, Working};
pub use control::Control;
pub use views::Views;

use crate::clock::Clock;
use crate::eye::Eye;
use crate::report::PlantReport;
use crate::store::{NewSession, Store, StoreError};

/// Decoded frames that wait for the network: 4 of 640 x 480 are 4 MB.
const FRAMES_WAITING: usize = 4;
/// Plants that wait to be fitted.
const PLANTS_WAITING: usize = 8;

/// What to run.
pub struct Run<'a> {
    /// The session: names, cameras, rows.
    pub manifest: &'a Manifest,
    /// Its species.
    pub species: &'a Species,
    /// Where plants go.
    pub store: &'a Store,
    /// What it shows of itself and how it is told to slow down or to stop.
    pub control: &'a Control,
    /// What events are dated by, and the plants of a live run.
    pub clock: &'a dyn Clock,
    /// Frames come from cameras: they do not wait and do not come again.
    pub live: bool,
}

/// What happened, told as it happens.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// A frame is through, or refused.
    Frame,
    /// A plant is stored.
    Plant(&'a PlantReport),
}

/// What came of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Outcome {
    /// Frames that came, good or bad.
    pub frames: u64,
    /// Frames refused at the gate, by reason.
    pub gate: Counts,
    /// Frames that passed the gate and still showed nothing, by reason.
    pub unseen: BTreeMap<&'static str, u64>,
    /// Plants that were seen and could not be kept, by reason.
    pub lost: BTreeMap<&'static str, u64>,
    /// Plants stored; what they are is told as they are: a season's would not fit into memory.
    pub plants: u64,
    /// Why the source ended early.
    pub ended: Option<String>,
    /// Time of the whole run, seconds.
    pub seconds: f64,
}

impl Outcome {
    /// Whether some frame or plant was lost on the way.
    #[must_use]
    pub fn is_partial(&self) -> bool {
        self.gate.refused_total() > 0 || !self.unseen.is_empty() || !self.lost.is_empty() || self.ended.is_some()
    }
}

/// Why a run stopped.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The store failed: nothing may be acknowledged any more.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A session's camera is none; manifests that were read have been checked for that.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A stage's thread died, which is a bug.
    #[error("the {stage} stage panicked")]
    Panicked {
        /// Which.
        stage: &'static str,
    },
}

/// Runs a source to its end. A bad frame or plant is counted, noted as an event and left behind.
///
/// # Errors
/// [`PipelineError`]; what was stored before stays.
pub fn run(
    run: &Run<'_>,
    source: &mut dyn Source,
    eye: &mut Eye,
    mut progress: impl FnMut(Progress<'_>),
) -> Result<Outcome, PipelineError> {
    let started = Instant::now();
    save_names(run, eye)?;
    let provenance = keep::provenance(eye);
    let models = eye.models().into_iter().map(|(_, sha256)| sha256.to_owned()).collect();
    let mut keeper = keep::Keeper { run, provenance, models, outcome: Outcome::default() };
    let looker = looker::Looker::new(run, eye)?;
    let joined = std::thread::scope(|scope| {
        let (to_looker, frames) = tokio::sync::mpsc::channel(FRAMES_WAITING);
        let (to_keeper, sights) = sync_channel(PLANTS_WAITING);
        let reader = scope.spawn(move || reader::read(run, source, &to_looker));
        let looker = scope.spawn(move || looker.look(frames, &to_keeper));
        let kept = sights.into_iter().try_for_each(|found| keeper.take(found, &mut progress));
        // With the receiver gone the stages before end at their next send.
        let counts = reader.join().map_err(|_panic| PipelineError::Panicked { stage: "reader" });
        let looked = looker.join().map_err(|_panic| PipelineError::Panicked { stage: "looker" });
        kept.map_err(PipelineError::from).and(looked).and(counts)
    });
    let mut outcome = keeper.outcome;
    (outcome.gate, outcome.ended) = joined?;
    outcome.seconds = started.elapsed().as_secs_f64();
    let frames_per_second = outcome.frames as f64 / outcome.seconds.max(1e-9);
    let detail = serde_json::json!({
        "session": run.manifest.session_id, "frames": outcome.frames, "refused": outcome.gate.refused,
        "unseen": outcome.unseen, "dropped": run.control.dropped(), "plants": outcome.plants,
        "lost": outcome.lost, "ended": outcome.ended,
        "frames_per_second": frames_per_second,
    });
    run.store.save_event(run.clock.now().wall, "run_finished", &detail)?;
    Ok(outcome)
}

/// What plants refer to goes into the store before them.
fn save_names(run: &Run<'_>, eye: &Eye) -> Result<(), StoreError> {
    let calibration = |camera: &demeter_capture::SessionCamera| serde_json::json!(camera);
    run.store.save_session(&NewSession {
        id: run.manifest.session_id.clone(),
        rig: run.manifest.rig_id.clone(),
        cameras: run.manifest.cameras.iter().map(|camera| (camera.id.0.clone(), calibration(camera))).collect(),
    })?;
    run.store.save_species(run.species)?;
    for degraded in eye.degraded() {
        tracing::warn!("{degraded}");
        let detail = serde_json::json!({"role": degraded.role, "why": degraded.why});
        run.store.save_event(run.clock.now().wall, "degraded", &detail)?;
    }
    eye.models().into_iter().try_for_each(|(name, sha256)| run.store.save_model(sha256, name))
}
