//! A plant in the making: organs are hung by the direction they leave in, and the joint's parameters follow.

use demeter_frame::Pose;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::DVector;
use rand::Rng;

use super::Seeded;
use crate::model::kinematics::attachment;
use crate::model::leaf::{self, Blade, ROWS, vein_angle};
use crate::model::stem::{self, BONES, StemCurve};
use crate::model::{Form, Joint, Organ, Plant, Species};

/// Organs so far with what their children need: rotation, size and curve of each.
pub(super) struct Sprout<'a> {
    species: &'a Species,
    organs: Vec<Organ>,
    posed: Vec<(DQuat, f64, Option<StemCurve>)>,
}

/// Where an organ hangs: parent and d, `None` on the ground.
pub(super) type Seat = Option<(usize, f64)>;

impl<'a> Sprout<'a> {
    pub(super) fn new(species: &'a Species) -> Self {
        Self { species, organs: Vec::new(), posed: Vec::new() }
    }

    /// Adds a stem whose base stands in the frame `base` of the plant; lengths in metres.
    pub(super) fn stem(&mut self, seat: Seat, base: DQuat, length: f64, radius: f64, gamma: Vec<f64>) -> usize {
        let ranges = &self.species.ranges;
        let (length, radius) = (ranges.stem_length.clamp(length), ranges.stem_radius.clamp(radius));
        let curve = self.species.stem.curve(&gamma);
        let form = Form::Stem { gamma, radius: radius / length };
        let chain_from_organ = curve.frames[0].inverse();
        self.hang(seat, base * chain_from_organ, length, form, Some(curve))
    }

    /// Adds a blade whose main vein leaves in the frame `base` of the plant; length in metres.
    pub(super) fn blade(&mut self, seat: Seat, base: DQuat, length: f64, blade: Blade, leaf: u16) {
        let length = self.species.ranges.blade_length.clamp(length);
        let chain_from_organ = self.species.leaf.grid(&blade).gauge.inverse();
        self.hang(seat, base * chain_from_organ, length, Form::Leaf { blade, leaf }, None);
    }

    fn hang(&mut self, seat: Seat, rotation: DQuat, length: f64, form: Form, curve: Option<StemCurve>) -> usize {
        let (parent, d, frame, size) = match seat {
            None => (None, 0.0, DQuat::IDENTITY, 1.0),
            Some((parent, d)) => {
                let (rotation, size, curve) = &self.posed[parent];
                let frame = curve.as_ref().map_or(DQuat::IDENTITY, |curve| attachment(curve, d).1);
                (Some(parent), d, *rotation * frame, *size)
            }
        };
        let local = Pose::new(frame.inverse() * rotation, DVec3::ZERO).rotation;
        self.organs.push(Organ { parent, joint: Joint { d, rotation: local, scale: length / size }, form });
        self.posed.push((rotation, length, curve));
        self.organs.len() - 1
    }

    /// The plant, standing at the world's origin.
    pub(super) fn finish(self) -> Plant {
        Plant { world_from_plant: Pose::IDENTITY, organs: self.organs }
    }
}

/// The base frame of a blade that leaves towards `azimuth`, `tilt` from the vertical, upper side up, then rolled.
pub(super) fn blade_frame(azimuth: f64, tilt: f64, roll: f64) -> DQuat {
    frame(azimuth, tilt, 1.0) * DQuat::from_rotation_y(roll)
}

/// The base frame of a stem: as a blade's, but +z points out and down, so that positive bends droop.
pub(super) fn stem_frame(azimuth: f64, tilt: f64) -> DQuat {
    frame(azimuth, tilt, -1.0)
}

fn frame(azimuth: f64, tilt: f64, side: f64) -> DQuat {
    let out = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
    let y = out * tilt.sin() + DVec3::Z * tilt.cos();
    let z = side * (DVec3::Z * tilt.sin() - out * tilt.cos());
    DQuat::from_mat3(&DMat3::from_cols(y.cross(z), y, z))
}

/// A standard normal number, cut at 2.5 (Box-Muller; what lies outside is drawn again).
pub(crate) fn normal(rng: &mut Seeded) -> f64 {
    loop {
        let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
        let x = radius * (std::f64::consts::TAU * rng.random::<f64>()).cos();
        if x.abs() <= 2.5 {
            return x;
        }
    }
}

/// Deformation of a blade that droops from base to tip by `turn` radians in all, evenly, as nearly as its species
/// knows how.
pub(super) fn drooping_blade(species: &Species, turn: f64) -> Vec<f64> {
    let mut angles = DVector::zeros(leaf::ANGLES);
    for row in 1..ROWS {
        // Turning about +x by a negative angle takes the tip away from the upper side.
        angles[vein_angle(row)] = -turn / (ROWS - 1) as f64;
    }
    species.leaf.deform.project(&angles)
}

/// Deformation of a stem that bends towards its +z by `turn` radians in all, evenly.
pub(super) fn bent_stem(species: &Species, turn: f64) -> Vec<f64> {
    let mut angles = DVector::zeros(stem::ANGLES);
    for bone in 0..BONES {
        angles[2 * bone] = turn / BONES as f64;
    }
    species.stem.deform.project(&angles)
}

/// `coefficients` moved by random ones times `spread`, within what the model allows.
pub(super) fn scattered(rng: &mut Seeded, coefficients: Vec<f64>, spread: f64) -> Vec<f64> {
    coefficients.into_iter().map(|c| (c + spread * normal(rng)).clamp(-3.0, 3.0)).collect()
}

/// The spread of each of a blade's bends, given for the 15 that hand-made species have: with more of them blades are not
/// bent more.
pub(super) fn bend_spread(species: &Species, of_fifteen: f64) -> f64 {
    of_fifteen * (15.0 / species.leaf.deform.rank() as f64).sqrt()
}

/// `count` standard normal coefficients times `spread`.
pub(super) fn coefficients(rng: &mut Seeded, count: usize, spread: f64) -> Vec<f64> {
    (0..count).map(|_| normal(rng) * spread).collect()
}
