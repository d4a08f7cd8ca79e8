use std::f64::consts::TAU;

use demeter_frame::{Intrinsics, Pose};
use glam::{DQuat, DVec3, Vec3};
use rand::Rng;

use super::scene::{Ground, Scene, Setting, WorldError};
use super::weather::daylight;
use super::{Backdrop, Seeded, Surface, grow, seeded};
use crate::model::{Detail, Plant, Species};

/// A row to be driven past.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// How many plants.
    pub plants: usize,
    /// Metres from plant to plant.
    pub spacing: f64,
    /// Age of the plants, 0..=1.
    pub age: f64,
    /// How many pictures, evenly from before the first plant to after the last.
    pub frames: usize,
}

/// A scene of a row along +x and the camera's poses (`world_from_camera`) as the rig drives along it on the -y side.
///
/// The camera looks across the row and down on it from 0.9 m or farther, so that a whole plant fits.
///
/// # Errors
/// [`WorldError`] when the organs are too many for one scene.
pub fn row(
    species: &Species,
    plan: &Row,
    intrinsics: &Intrinsics,
    seed: u64,
) -> Result<(Scene, Vec<Pose>), WorldError> {
    let mut rng = seeded(seed);
    let mut plants = Vec::with_capacity(plan.plants);
    for i in 0..plan.plants {
        let age = plan.age * rng.random_range(0.85..1.15);
        let plant = grow(species, age, &mut rng);
        let at = DVec3::new(
            plan.spacing * (i as f64 + rng.random_range(-0.1..0.1)),
            plan.spacing * rng.random_range(-0.06..0.06),
            0.0,
        );
        plants.push((species, stand(plant, at, rng.random_range(0.0..TAU))));
    }
    let scene = Scene::new(plants, field(&mut rng), Detail::Coarse, seed)?;
    let height = f64::from(scene.bounds().1.z);
    let half_view = (0.5 * f64::from(intrinsics.height) / intrinsics.fy).atan();
    // Half the plant's height and a margin must fit into half the view.
    let distance = (0.65 * height / half_view.tan()).max(0.9);
    let eye_z = (0.75 * height).max(0.35) + 0.3 * distance;
    let length = plan.spacing * plan.plants.saturating_sub(1) as f64;
    let poses = (0..plan.frames).map(|frame| {
        let along = (frame as f64 + 0.5) / plan.frames as f64;
        // The rig shakes by some millimetres and tenths of a degree (guess).
        let mut shake = |by: f64| rng.random_range(-by..by);
        let eye = DVec3::new(length * along + shake(0.003), -distance + shake(0.005), eye_z + shake(0.005));
        let target = DVec3::new(eye.x + shake(0.004), 0.0, 0.45 * height + shake(0.004));
        Pose::looking_at(eye, target, DVec3::Z)
    });
    let poses = poses.collect();
    Ok((scene, poses))
}

/// Soil under a random sky.
pub(super) fn field(rng: &mut Seeded) -> Setting {
    let brown = Vec3::new(0.17, 0.12, 0.08).lerp(Vec3::new(0.2, 0.19, 0.18), rng.random());
    Setting {
        ground: Ground {
            z: 0.0,
            surface: Surface::Soil {
                colour: brown * rng.random_range(0.5f32..1.8),
                stones: rng.random_range(0.0f32..1.0).powf(1.5),
                straw: rng.random_range(0.0f32..0.6).powi(2),
                weeds: if rng.random_bool(0.3) { rng.random_range(0.0..0.2) } else { 0.0 },
            },
        },
        backdrop: Backdrop::Sky { brightness: rng.random_range(0.8..2.5) },
        pot: None,
        light: daylight(rng),
        shade: None,
    }
}

/// A plant moved from the origin to `at` and turned about the vertical.
pub(super) fn stand(plant: Plant, at: DVec3, turn: f64) -> Plant {
    let world_from_origin = Pose::new(DQuat::from_rotation_z(turn), at);
    Plant { world_from_plant: world_from_origin.then(&plant.world_from_plant), ..plant }
}
