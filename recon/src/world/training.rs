//! Pictures to train on: everything that may vary does.

use std::f64::consts::{PI, TAU};

use demeter_frame::{Intrinsics, Pinhole, Pose};
use glam::{DVec3, Vec3};
use rand::Rng;

use super::row::{Lab, daylight, direction, field, lab, stand};
use super::scene::{Backdrop, Ground, Light, Pot, Scene, Setting, WorldError};
use super::surface::Surface;
use super::{Seeded, Sensor, View, grow, render, seeded};
use crate::model::{Detail, Species};

/// A random picture of `size` x `size` pixels with its truth and its camera: of every hundred about 35 are potted maize from the side
/// before white, 10 potted soybeans, 55 rows, patches and views from above, of which three quarters are soybeans.
///
/// # Errors
/// [`WorldError`], which valid species rule out.
pub fn training_view(soybean: &Species, maize: &Species, size: u32, seed: u64) -> Result<(View, Pinhole), WorldError> {
    let mut rng = seeded(seed);
    let kind = rng.random_range(0..100);
    let (scene, camera, exposure) = if kind < 45 {
        potted(if kind < 35 { maize } else { soybean }, size, &mut rng)?
    } else {
        let species = if rng.random_bool(0.27) { maize } else { soybean };
        outdoors(species, size, &mut rng)?
    };
    let tint = |rng: &mut Seeded| rng.random_range(0.85f32..1.15);
    let sensor = Sensor {
        samples: 2,
        exposure: exposure * rng.random_range(0.75f32..1.3),
        white_balance: Vec3::new(tint(&mut rng), 1.0, tint(&mut rng)),
        blur: if rng.random_bool(0.4) { rng.random_range(0.2..1.1) } else { 0.0 },
        shot_noise: rng.random_range(0.0f32..0.2).powi(2),
        read_noise: rng.random_range(0.0f32..0.1).powi(2),
    };
    Ok((render(&scene, &camera, &sensor, &mut rng), camera))
}

/// A camera looking from `direction` at the plants' box so that they fill about `fill` of the picture.
fn aim(scene: &Scene, from: DVec3, fill: f64, size: u32, rng: &mut Seeded) -> Pinhole {
    let intrinsics = Intrinsics::from_hfov(size, size, rng.random_range(30f64..80.0).to_radians());
    let (low, high) = scene.bounds();
    let half = (high - low).as_dvec3() * 0.5;
    let look = Pose::looking_at(from, DVec3::ZERO, DVec3::Z).rotation;
    let extent = |axis: DVec3| (axis.abs() * half).element_sum();
    let (across, up, deep) = (extent(look * DVec3::X), extent(look * DVec3::Y), extent(look * DVec3::Z));
    let reach = across.max(up) / fill;
    let distance = reach * intrinsics.fx / (0.5 * f64::from(size)) + 0.5 * deep.min(reach);
    let jitter = DVec3::new(rng.random_range(-0.15..0.15), rng.random_range(-0.15..0.15), 0.0) * reach;
    let target = (low + high).as_dvec3() * 0.5 + look * jitter;
    let mut eye = target + from.normalize() * distance;
    eye.z = eye.z.max(scene.setting.ground.z + 0.05);
    let up = DVec3::new(0.06 * rng.random_range(-1.0..1.0), 0.0, 1.0);
    // Straight down has no upright: turn the picture at random instead.
    let up = if from.z > 0.95 * from.length() { direction(rng.random_range(0.0..TAU), 0.0).as_dvec3() } else { up };
    Pinhole { intrinsics, world_from_camera: Pose::looking_at(eye, target, up) }
}

fn potted(species: &Species, size: u32, rng: &mut Seeded) -> Result<(Scene, Pinhole, f32), WorldError> {
    let plant = stand(grow(species, rng.random(), rng), DVec3::ZERO, rng.random_range(0.0..TAU));
    let pale = Vec3::new(1.0, rng.random_range(0.92..1.0), rng.random_range(0.82..1.0));
    let (wall, exposure) = match rng.random_range(0..20) {
        0..13 => (Surface::Plain { colour: pale * rng.random_range(0.8f32..1.3) }, 0.75),
        13..15 => (Surface::Chamber { colour: pale, half_width: rng.random_range(0.4..0.9) }, 0.5),
        15..17 => (Surface::Plain { colour: pale * rng.random_range(0.1f32..0.6) }, 0.35),
        _ => (Surface::Clutter { size: rng.random_range(0.05f32..0.6) }, 0.3),
    };
    let radius = rng.random_range(0.07..0.16);
    let pot = Pot {
        radius,
        height: radius * rng.random_range(1.2..2.2),
        colour: Vec3::splat(rng.random_range(0.02f32..0.9)),
    };
    // Crops of imaging chambers show no floor.
    let floor = if rng.random_bool(0.75) { -4.0 } else { -pot.height - rng.random_range(0.0..0.4) };
    let lamp = rng.random_range(0.0f32..0.9);
    let light = Light {
        to_sun: direction(rng.random_range(0.0..TAU), rng.random_range(0.2..1.4)),
        sun: Vec3::new(1.0, 0.97, 0.9) * lamp,
        // Lamps behind the wall leave the plant dark, lamps in front do not.
        ambient: Vec3::splat(rng.random_range(0.1f32..0.9)),
    };
    let scene = lab(species, plant, &Lab { wall, floor, pot, light }, rng.random())?;
    let azimuth = -0.5 * PI + rng.random_range(-0.1..0.1);
    let from = direction(azimuth, rng.random_range(-0.05..0.25)).as_dvec3();
    let fill = if rng.random_bool(0.3) { rng.random_range(1.2..2.4) } else { rng.random_range(0.85..1.2) };
    let camera = aim(&scene, from, fill, size, rng);
    Ok((scene, camera, exposure))
}

fn outdoors(species: &Species, size: u32, rng: &mut Seeded) -> Result<(Scene, Pinhole, f32), WorldError> {
    let age: f64 = rng.random::<f64>().powf(1.3);
    let height = 0.15 + age * if species.name == "maize" { 1.6 } else { 0.7 };
    let in_row = rng.random_bool(0.55);
    let count = if in_row { rng.random_range(3..9) } else { rng.random_range(1..7) };
    let spacing = rng.random_range(0.25..0.8) * height;
    // Two or three grown plants stand several times, turned: growing is what costs.
    let kinds: Vec<_> = (0..3).map(|_| grow(species, age * rng.random_range(0.8..1.2), rng)).collect();
    let mut plants = Vec::new();
    for i in 0..count {
        let at = if in_row {
            DVec3::new(spacing * (f64::from(i) + rng.random_range(-0.15..0.15)), rng.random_range(-0.03..0.03), 0.0)
        } else {
            let radius = spacing * f64::from(i).sqrt();
            let angle = rng.random_range(0.0..TAU);
            DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
        };
        let kind = kinds[rng.random_range(0..kinds.len())].clone();
        plants.push((species, stand(kind, at, rng.random_range(0.0..TAU))));
    }
    let mut setting = field(rng);
    let sheet = rng.random_range(0..10);
    if sheet < 4 {
        let surface = match sheet {
            0 => Surface::Plain { colour: Vec3::splat(rng.random_range(0.05f32..0.9)) },
            _ => Surface::Clutter { size: height as f32 * rng.random_range(0.1f32..1.5) },
        };
        setting = Setting { ground: Ground { z: 0.0, surface }, light: daylight(rng), ..setting };
        if rng.random_bool(0.5) {
            setting.backdrop = Backdrop::Wall { distance: 4.0 * height + 3.0, surface };
        }
    }
    let scene = Scene::new(plants, setting, Detail::Coarse, rng.random())?;
    let above = match rng.random_range(0..10) {
        0..3 => rng.random_range(1.3..1.57),
        3..8 => rng.random_range(0.2..0.8),
        _ => rng.random_range(0.8..1.3),
    };
    let from = direction(-0.5 * PI + rng.random_range(-0.6..0.6), above).as_dvec3();
    let fill = if in_row { rng.random_range(1.2..4.0) } else { rng.random_range(0.9..2.6) };
    let camera = aim(&scene, from, fill, size, rng);
    Ok((scene, camera, 0.22))
}
