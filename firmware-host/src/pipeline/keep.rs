//! The last stage: plants are fitted, pictured and stored.

use std::time::Instant;

use demeter_recon::view::Closed;
use serde_json::{Value, json};

use super::looker::{BestView, Found, FrameKey};
use super::place::{Beside, Place, place};
use super::{Outcome, Progress, Run, Working};
use crate::clock::wall_time;
use crate::describe::{Encoding, describe};
use crate::error::chain;
use crate::eye::Eye;
use crate::picture;
use crate::reconstruct::{ReconstructError, fit_organs};
use crate::store::{NewPlant, Saved, StoreError};

/// What every plant of the run depends on besides its frames.
pub(super) fn provenance(eye: &Eye) -> Value {
    let mut models = eye.models().into_iter();
    let (model, sha256) = models.next().unzip();
    let mut provenance = json!({
        "program": env!("CARGO_PKG_NAME"), "version": env!("CARGO_PKG_VERSION"), "model": model, "sha256": sha256
    });
    let others: Vec<_> = models.map(|(model, sha256)| json!({"model": model, "sha256": sha256})).collect();
    if !others.is_empty() {
        provenance["others"] = json!(others);
    }
    provenance
}

pub(super) struct Keeper<'a> {
    pub run: &'a Run<'a>,
    pub provenance: Value,
    /// Every network's SHA-256, ours first.
    pub models: Vec<String>,
    pub outcome: Outcome,
}

impl Keeper<'_> {
    /// Takes what the looker found. Only the store's own failure is an error. A plant that comes when the run must have
    /// ended is left out whole.
    pub(super) fn take(&mut self, found: Found, progress: &mut impl FnMut(Progress<'_>)) -> Result<(), StoreError> {
        let run = self.run;
        let working = run.control.keeper.work();
        match found {
            Found::Plant(_) if run.control.overdue() => *self.outcome.lost.entry("stopped").or_default() += 1,
            Found::Seen { milliseconds } => {
                tracing::debug!(milliseconds, "frame");
                self.outcome.frames += 1;
                progress(Progress::Frame);
            }
            Found::Refused { frame, reason, message } => {
                self.outcome.frames += 1;
                self.note("frame_refused", &json!({"frame": frame, "reason": reason, "message": message}))?;
                progress(Progress::Frame);
            }
            Found::Unseen { frame: (camera, seq), reason, message } => {
                // A plant without a place is one of a frame that was counted as seen.
                if reason != "no_place" {
                    self.outcome.frames += 1;
                    progress(Progress::Frame);
                }
                *self.outcome.unseen.entry(reason).or_default() += 1;
                let detail = json!({"frame": [camera.0, seq], "reason": reason, "message": message});
                self.note("frame_unseen", &detail)?;
            }
            Found::Plant(plant) => self.plant(&plant, &working, progress)?,
        }
        Ok(())
    }

    fn plant(
        &mut self,
        closed: &Closed<FrameKey, BestView>,
        working: &Working<'_>,
        progress: &mut impl FnMut(Progress<'_>),
    ) -> Result<(), StoreError> {
        let started = Instant::now();
        let id = format!("{}-{:04}", self.run.manifest.session_id, closed.number);
        working.pause(|| self.run.control.wait_for_position(&closed.best.stamp));
        let mut plant = match self.new_plant(closed, id.clone()) {
            Ok(plant) => plant,
            Err(error) => {
                *self.outcome.lost.entry(error.name()).or_default() += 1;
                tracing::warn!("plant {id}: {}", chain(&error));
                return self
                    .note("plant_lost", &json!({"plant": id, "reason": error.name(), "message": chain(&error)}));
            }
        };
        match self.save(&plant, working) {
            // A value that the store does not take costs this plant; a store that does not work ends the run.
            Err(error)
                if error.is_full() || matches!(error, StoreError::Value { .. } | StoreError::Conflict { .. }) =>
            {
                *self.outcome.lost.entry("not_stored").or_default() += 1;
                tracing::warn!("plant {id}: {}", chain(&error));
                self.note("plant_lost", &json!({"plant": id, "reason": "not_stored", "message": chain(&error)}))
            }
            Err(error) => Err(error),
            Ok(_) => {
                let milliseconds = started.elapsed().as_secs_f64() * 1e3;
                self.note("plant_stored", &json!({"plant": id, "ms": milliseconds}))?;
                plant.report.ms = Some(milliseconds);
                progress(Progress::Plant(&plant.report));
                self.outcome.plants += 1;
                Ok(())
            }
        }
    }

    /// Saves the plant, waiting for room where the disk is full: nothing in hand is given up for that.
    fn save(&self, plant: &NewPlant, working: &Working<'_>) -> Result<Saved, StoreError> {
        loop {
            working.pause(|| self.run.control.wait_for_room());
            match self.run.store.save_plant(plant) {
                Err(error) if error.is_full() && !self.run.control.overdue() => {
                    tracing::error!("plant waits for room: {}", chain(&error));
                    self.run.control.storage_full(true);
                }
                done => return done,
            }
        }
    }

    fn new_plant(&self, closed: &Closed<FrameKey, BestView>, id: String) -> Result<NewPlant, ReconstructError> {
        let (best, species) = (&closed.best, self.run.species);
        let (fitted, tree) = fit_organs(best.organs.clone(), species, glam::DVec3::Z)?;
        let cloud: Vec<_> = tree.organs.into_iter().flat_map(|organ| organ.points).collect();
        let mut made = describe(&fitted, species, &cloud, best.scale_source, Encoding::Compact)?;
        made.report.id = Some(id);
        if best.stand_in {
            made.report.warnings.push("no main stem was seen: one was put through the leaves' bases".into());
        }
        if !best.whole {
            made.report.warnings.push("the plant was never whole in a picture".into());
        }
        let beside = best.crop.beside(&made.plant, species, best.world_from_camera.inverse())?;
        let mut provenance = self.provenance.clone();
        let (camera, seq) = &closed.best_frame;
        provenance["best_frame"] = json!([camera.0, seq]);
        let placed = self.place(closed);
        if let Some(placed) = &placed {
            provenance["position"] = placed.provenance.clone();
        }
        let (time, time_trusted) = match self.run.live {
            true => wall_time(self.run.clock, &best.stamp),
            // A recording does not say whether its clock was synchronised.
            false => (best.stamp.wall.clone(), false),
        };
        Ok(NewPlant {
            report: made.report,
            record: made.record,
            session: self.run.manifest.session_id.clone(),
            time,
            time_trusted,
            position: Some(closed.position.extend(0.0)),
            geographic: placed.map(|placed| placed.geographic),
            models: self.models.clone(),
            provenance,
            observations: closed.frames.iter().map(|(camera, seq)| (camera.0.clone(), *seq)).collect(),
            thumbnail: picture::png(&beside).ok(),
        })
    }

    /// Where on Earth the plant stands, where the rig knew where it was when it saw the plant best.
    fn place(&self, closed: &Closed<FrameKey, BestView>) -> Option<Place> {
        let best = &closed.best;
        let antenna = self.run.control.positions().at(&best.stamp)?;
        let plant = closed.position - best.world_from_camera.translation.truncate();
        let arm = self.run.manifest.cameras_from_antenna_m.unwrap_or_default();
        Some(place(&antenna, &Beside { plant, forward: best.forward, arm }))
    }

    fn note(&self, kind: &str, detail: &Value) -> Result<(), StoreError> {
        match self.run.store.save_event(self.run.clock.now().wall, kind, detail) {
            // An event is no plant: on a full disk it is said in the log alone.
            Err(error) if error.is_full() => {
                tracing::warn!("{kind} {detail}: {}", chain(&error));
                Ok(())
            }
            saved => saved,
        }
    }
}
