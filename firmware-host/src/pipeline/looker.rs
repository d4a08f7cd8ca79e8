//! The second stage: network, lifting, and which plant along the row each sight belongs to.

use std::collections::BTreeMap;
use std::sync::mpsc::SyncSender;
use std::time::Instant;

use demeter_frame::{CameraError, CameraId, Frame, Pose, Rgb, Stamp, Undistort};
use demeter_recon::organs::{OrganCloud, ScaleSource};
use demeter_recon::view::{Closed, Gate, Observation, Quality, Tracker};
use glam::DVec2;
use tokio::sync::mpsc::Receiver;

use super::Run;
use super::reader::Arrival;
use crate::error::chain;
use crate::eye::{Eye, Sight};
use crate::picture::Crop;

/// A frame's name.
pub(super) type FrameKey = (CameraId, u64);

/// What is kept of a plant's best view.
#[derive(Clone, Debug)]
pub(super) struct BestView {
    pub organs: Vec<OrganCloud>,
    pub stand_in: bool,
    pub whole: bool,
    pub scale_source: ScaleSource,
    pub world_from_camera: Pose,
    pub crop: Crop,
    pub stamp: Stamp,
    /// The direction of the drive, in the world's plane.
    pub forward: Option<DVec2>,
}

/// What leaves the stage, in the order of the frames.
pub(super) enum Found {
    /// A frame showed something.
    Seen { milliseconds: f64 },
    /// A frame was refused at the gate.
    Refused { frame: Option<(String, u64)>, reason: &'static str, message: String },
    /// A frame passed the gate and showed nothing.
    Unseen { frame: FrameKey, reason: &'static str, message: String },
    /// The rig has passed a plant.
    Plant(Box<Closed<FrameKey, BestView>>),
}

/// The stage's state.
pub(super) struct Looker<'a> {
    run: &'a Run<'a>,
    eye: &'a mut Eye,
    tracker: Tracker<FrameKey, BestView>,
    odometer: Odometer,
    /// Cameras whose pictures are straightened before anything is measured in them.
    lenses: BTreeMap<CameraId, Undistort>,
}

impl<'a> Looker<'a> {
    pub(super) fn new(run: &'a Run<'a>, eye: &'a mut Eye) -> Result<Self, CameraError> {
        let spacing = run.manifest.rows.iter().filter_map(|row| row.plant_spacing_m).reduce(f64::min);
        let mut lenses = BTreeMap::new();
        for camera in &run.manifest.cameras {
            if let Some(lens) = Undistort::of(&camera.calibration()?) {
                lenses.insert(camera.id.clone(), lens);
            }
        }
        let tracker = Tracker::new(Gate::of_spacing(spacing));
        Ok(Self { run, eye, tracker, odometer: Odometer::default(), lenses })
    }

    /// Works until no more frames come or nobody listens. A recording that was stopped leaves the plants in view out:
    /// half-seen they would stand in the way of the whole ones when it is replayed. A camera never sees them again.
    pub(super) fn look(mut self, mut frames: Receiver<Arrival>, to: &SyncSender<Found>) {
        let control = self.run.control;
        while let Some(arrival) = frames.blocking_recv() {
            if control.overdue() {
                break;
            }
            let started = Instant::now();
            let working = control.looker.work();
            let found = match arrival {
                Arrival::Refused { frame, reason, message } => vec![Found::Refused { frame, reason, message }],
                Arrival::Frame(frame, rgb) => self.frame(&frame, &rgb),
            };
            drop(working);
            let worked = started.elapsed();
            if found.into_iter().any(|found| to.send(found).is_err()) {
                return;
            }
            control.rest(worked);
        }
        if control.stopping() && !self.run.live {
            return;
        }
        for plant in self.tracker.finish() {
            if to.send(Found::Plant(Box::new(plant))).is_err() {
                return;
            }
        }
    }

    fn frame(&mut self, frame: &Frame, rgb: &Rgb) -> Vec<Found> {
        let key = (frame.camera.clone(), frame.seq);
        let unseen = |reason, message| vec![Found::Unseen { frame: key.clone(), reason, message }];
        let Some(camera) = self.run.manifest.camera(&frame.camera) else {
            return unseen("unknown_camera", format!("camera {} is not in the session", frame.camera));
        };
        let Some(pose) = frame.world_from_camera else {
            return unseen("no_pose", "the session has no pose for the frame, so its plants have no place".into());
        };
        let started = Instant::now();
        let straight;
        let (rgb, intrinsics) = match self.lenses.get(&frame.camera).map(|lens| (lens.picture(rgb), lens.pinhole())) {
            None => (rgb, &camera.intrinsics),
            Some((Ok(picture), pinhole)) => {
                straight = picture;
                (&straight, pinhole)
            }
            Some((Err(error), _)) => return unseen("picture_size", error.to_string()),
        };
        let sight = match self.eye.look(rgb, intrinsics, Some(pose)) {
            Ok(sight) => sight,
            Err(error) => return unseen(error.name(), chain(&error)),
        };
        for degraded in &sight.degraded {
            metrics::counter!("demeter_degraded_total").increment(1);
            tracing::warn!("frame {}: {degraded}", frame.seq);
        }
        let travelled = self.odometer.advance(&frame.camera, pose.translation.truncate());
        let seen = observations(sight, frame, rgb, intrinsics, pose, self.odometer.forward(&frame.camera));
        let (closed, misplaced) = self.tracker.frame(&key, travelled, seen);
        let mut found = vec![Found::Seen { milliseconds: started.elapsed().as_secs_f64() * 1e3 }];
        if !misplaced.is_empty() {
            let message = format!("{} plants without a finite place", misplaced.len());
            found.push(Found::Unseen { frame: key, reason: "no_place", message });
        }
        found.extend(closed.into_iter().map(|plant| Found::Plant(Box::new(plant))));
        found
    }
}

fn observations(
    sight: Sight,
    frame: &Frame,
    rgb: &Rgb,
    camera: &demeter_frame::Intrinsics,
    world_from_camera: Pose,
    forward: Option<DVec2>,
) -> Vec<Observation<BestView>> {
    let scale_source = sight.scale_source;
    let observation = |seen: crate::eye::PlantSight| {
        let whole = !seen.plant.touches_border;
        Observation {
            position: seen.ground,
            camera: world_from_camera.translation.truncate(),
            quality: Quality { whole, pixels: seen.plant.pixels, off_centre: seen.off_centre },
            view: BestView {
                organs: seen.plant.organs,
                stand_in: seen.plant.stand_in,
                whole,
                scale_source,
                world_from_camera,
                crop: Crop::around(rgb, camera, seen.bounds, Crop::THUMBNAIL),
                stamp: frame.stamp.clone(),
                forward,
            },
        }
    };
    sight.plants.into_iter().map(observation).collect()
}

/// How far the rig has gone: the longest way of any of its cameras over the ground, metres.
#[derive(Debug, Default)]
struct Odometer {
    cameras: BTreeMap<CameraId, Driven>,
}

#[derive(Debug)]
struct Driven {
    at: DVec2,
    way: f64,
    forward: Option<DVec2>,
}

/// A camera that moves less from one picture to the next stands, metres (a guess).
const STANDS: f64 = 1e-3;

impl Odometer {
    fn advance(&mut self, camera: &CameraId, at: DVec2) -> f64 {
        let start = Driven { at, way: 0.0, forward: None };
        let driven = self.cameras.entry(camera.clone()).or_insert(start);
        let step = at - driven.at;
        if step.length() >= STANDS {
            driven.forward = step.try_normalize();
        }
        driven.way += step.length();
        driven.at = at;
        self.cameras.values().map(|driven| driven.way).fold(0.0, f64::max)
    }

    /// The direction in which the camera moved last, of unit length.
    fn forward(&self, camera: &CameraId) -> Option<DVec2> {
        self.cameras.get(camera)?.forward
    }
}
