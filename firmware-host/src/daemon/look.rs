//! The daemon's tick: look at everything, say how it is.

use std::ops::ControlFlow::{self, Break, Continue};
use std::time::Instant;

use demeter_capture::{CameraState, PositionHealth, PositionState};
use sd_notify::NotifyState;
use serde_json::json;

use super::disk::Room;
use super::event::Event;
use super::watchdog::{self, STUCK};
use super::{Daemon, Links, notify};
use crate::clock::Clock;
use crate::error::{CommandError, Exit};
use crate::status::{Activity, CameraStatus, Health, Reason, Stage, Status};

/// Ticks between two looks at everything: one second.
const LOOK_EVERY: u32 = 4;

/// Ticks between two questions whether the clock is synchronised: 10 s, because each starts a small program.
const CLOCK_EVERY: u32 = 40;

impl Daemon {
    pub(super) fn tick(&mut self, links: &Links) -> ControlFlow<Result<Exit, CommandError>> {
        let now = Instant::now();
        if self.give_up.is_some_and(|give_up| now >= give_up) {
            tracing::warn!("the pipeline did not end in time and is left to itself");
            return Break(Ok(Exit::Done));
        }
        if self.steps.is_multiple_of(CLOCK_EVERY) {
            let clock = self.clock.clone();
            tokio::task::spawn_blocking(move || clock.ask());
        }
        if self.steps.is_multiple_of(LOOK_EVERY) {
            self.look(now, links);
        }
        self.steps = self.steps.wrapping_add(1);
        let health = self.status.borrow().health;
        // Tried again at the next step: the output may be a device that comes later.
        self.dark = self.lamp.show(health).err().map(|error| error.to_string());
        Continue(())
    }

    /// Reads the sensors, tells the line, asks the store, feeds the watchdog.
    fn look(&mut self, now: Instant, links: &Links) {
        let heat = self.thermal.update(now);
        let waiting = self.line.as_ref().is_some_and(|control| control.is_full());
        let disk = self.disk.update(waiting);
        self.tend_reserve(&disk, waiting);
        let (mut stages, mut cameras, mut position, mut frames_dropped) = (Vec::new(), Vec::new(), None, 0);
        if let Some(control) = &self.line {
            control.slow_down(heat.slowness);
            control.storage_full(disk.full);
            stages = watchdog::stages(control, now);
            cameras = control.cameras();
            position = control.position_health();
            frames_dropped = control.dropped();
        }
        let before = self.status.borrow().clone();
        if (before.heat.slowness, before.disk.full) != (heat.slowness, disk.full) {
            tracing::info!(slowness = heat.slowness, full = disk.full, "load");
            self.note("load", json!({"heat": heat, "disk": disk}));
        }
        let time_trusted = self.clock.synchronised();
        let status = Status { stages, cameras, position, frames_dropped, time_trusted, heat, disk, ..before };
        let reasons = self.reasons(&status, self.store_beat.silent(now));
        let health = reasons.first().map_or(Health::Works, |reason| reason.health);
        if watchdog::alive(&status.stages, &self.store_beat, now) {
            notify(&[NotifyState::Watchdog]);
        }
        self.status.send_replace(Status { health, reasons, ..status });
        if self.store_beat.ask() {
            let (api, news) = (links.api.clone(), links.news.clone());
            tokio::spawn(async move {
                let well = api.alive().await;
                news.send(Event::StoreAnswered(well)).await.unwrap_or_default();
            });
        }
    }

    /// Gives the store's reserve back or takes it, without waiting for the disk.
    fn tend_reserve(&self, disk: &Room, failed: bool) {
        if let Some(hold) = self.disk.change(disk, failed) {
            let reserve = self.disk.reserve();
            let tend = move || match reserve.hold(hold) {
                Ok(()) => tracing::info!("the store's reserve is {}", if hold { "held" } else { "given back" }),
                Err(error) => tracing::warn!("the store's reserve: {error}"),
            };
            tokio::task::spawn_blocking(tend);
        }
    }

    /// What is not as it should be, worst first.
    fn reasons(&self, status: &Status, silent: bool) -> Vec<Reason> {
        let broken = |kind, message| Reason { health: Health::Broken, kind, message };
        let degraded = |kind, message| Reason { health: Health::Degraded, kind, message };
        let failed = match &status.activity {
            Activity::Failed(why) => Some(broken("pipeline", why.clone())),
            _ => None,
        };
        let silent = silent.then(|| broken("store", format!("the store has not answered for {} s", STUCK.as_secs())));
        let full = status.disk.full.then(|| {
            let enough = status.disk.enough_bytes >> 20;
            broken("storage_full", format!("the disk is full: plants wait until {enough} MiB are free"))
        });
        let stuck = |stage: &Stage| {
            let seconds = stage.busy_seconds.unwrap_or_default();
            broken("stuck", format!("the {} has been at one item for {seconds:.0} s", stage.name))
        };
        let stuck = status.stages.iter().filter(|stage| stage.stuck).map(stuck);
        let is_lost = |camera: &&CameraStatus| camera.health.state == CameraState::Lost;
        let all_lost = status.cameras.iter().all(|camera| is_lost(&camera));
        let lost = |CameraStatus { health, .. }: &CameraStatus| {
            let why = health.last_error.as_deref().unwrap_or("no frames");
            let message = format!("camera {} gives no frames: {why}", health.id);
            if all_lost { broken("camera", message) } else { degraded("camera", message) }
        };
        let lost = status.cameras.iter().filter(is_lost).map(lost);
        let lens = |CameraStatus { health, lens }: &CameraStatus| {
            lens.as_ref().map(|lens| degraded("lens", format!("camera {}: {lens}", health.id)))
        };
        let lenses = status.cameras.iter().filter_map(lens);
        let position = status.position.as_ref().and_then(no_position).map(|why| degraded("position", why));
        let hot = (status.heat.slowness > 1).then(|| {
            let (celsius, part) = (status.heat.celsius.unwrap_or_default(), status.heat.slowness);
            degraded("hot", format!("the box is hot ({celsius:.0} °C) and works 1 second in {part}"))
        });
        let refused = self.refused.clone().map(|why| degraded("configuration", why));
        let dark = self.dark.clone().map(|why| degraded("lamp", why));
        failed
            .into_iter()
            .chain(silent)
            .chain(full)
            .chain(stuck)
            .chain(lost)
            .chain(lenses)
            .chain(position)
            .chain(hot)
            .chain(refused)
            .chain(dark)
            .collect()
    }
}

/// Why plants have no place on Earth just now; a receiver that was only just opened is given time.
fn no_position(health: &PositionHealth) -> Option<String> {
    let receiver = &health.receiver;
    match (health.state, &health.last_error) {
        (PositionState::Lost, Some(why)) => Some(format!("{receiver}: {why}")),
        (PositionState::NoFix | PositionState::Lost, _) => Some(format!("{receiver}: no fix")),
        (PositionState::Starting | PositionState::Fix, _) => None,
    }
}
