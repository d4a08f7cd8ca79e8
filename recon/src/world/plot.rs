//! Plants outdoors: the rows that a field robot sees, and plants from near.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use demeter_frame::{Intrinsics, Pinhole, Pose};
use glam::{DQuat, DVec3, Vec3};
use rand::Rng;

use super::nursery::{Bed, Wanted};
use super::row::field;
use super::training::{Shot, aim};
use super::weather::{daylight, direction};
use super::{Backdrop, Ground, Nursery, Scene, Seeded, Setting, Shade, StandingMesh, Surface, WorldError};

/// Triangles of a scene at most, about: what two renderings, the camera's and the sun's, do in a tenth of a second.
const TRIANGLES: usize = 300_000;
/// Plants farther away are specks.
const FARTHEST: f64 = 14.0;
/// From here on plants are drawn with few faces: a leaf is then some pixels long.
const FAR: f64 = 2.5;
/// How high crops stand under the mast, in its heights: from seedlings of some centimetres to leaves that hide the soil.
const LOWEST: f64 = 0.03;
const HIGHEST: f64 = 0.75;

/// Rows on a field from the height of a robot's mast, looking along them or across, weeds between.
pub(super) fn rows(nursery: &Nursery, size: u32, rng: &mut Seeded) -> Result<Shot, WorldError> {
    let wanted = if rng.random_bool(0.7) { Wanted::Broad } else { Wanted::Grass };
    let bed = nursery.bed(wanted, 4, rng)?;
    let weeds = nursery.bed(Wanted::Any, 4, rng)?;
    let intrinsics = Intrinsics::from_hfov(size, size, rng.random_range(40f64..110.0).to_radians());
    let height = rng.random_range(0.5..1.7);
    // Mostly as robots look at rows, some along the horizon and some straight down.
    let pitch: f64 = match rng.random_range(0..20) {
        0..12 => -rng.random_range(0.3..0.9),
        12..17 => -rng.random_range(0.0..0.3),
        _ => -rng.random_range(0.9..1.5),
    };
    let yaw = if rng.random_bool(0.7) { rng.random_range(-0.3..0.3) } else { rng.random_range(-PI..PI) };
    let eye = DVec3::new(rng.random_range(-0.4..0.4), 0.0, height);
    let ahead = direction(0.5 * PI + yaw, pitch).as_dvec3();
    let level = Pose::looking_at(eye, eye + ahead, DVec3::Z);
    let roll = if rng.random_bool(0.2) { rng.random_range(-0.4..0.4) } else { rng.random_range(-0.08..0.08) };
    let camera =
        Pinhole { intrinsics, world_from_camera: level.then(&Pose::new(DQuat::from_rotation_z(roll), DVec3::ZERO)) };

    // Crops stay below the mast: higher ones would only fill the picture. Half of them are young: robots weed early.
    let tall = f64::from(bed.height).max(0.02);
    let crop_size = (height * rng.random_range(LOWEST.ln()..HIGHEST.ln()).exp() / tall).min(1.2);
    let (between, along) = (rng.random_range(0.3..0.8), rng.random_range(0.12..0.45));
    let gaps = if rng.random_bool(0.3) { rng.random_range(0.0..0.6) } else { 0.05 };
    let mut spots = Vec::new();
    let count = |step: f64| (FARTHEST / step) as i32;
    for i in -count(between)..=count(between) {
        for j in -count(along)..=count(along) {
            let scatter = 0.1 * along;
            let x = f64::from(i) * between + rng.random_range(-scatter..scatter);
            let y = f64::from(j) * along + rng.random_range(-scatter..scatter);
            if rng.random_bool(1.0 - gaps) {
                spots.push((DVec3::new(x, y, 0.0), true, crop_size * rng.random_range(0.75..1.25)));
            }
        }
    }
    if rng.random_bool(0.6) {
        let weed_size = crop_size.min(0.3 * height / f64::from(weeds.height).max(0.02));
        for _ in 0..rng.random_range(1..120) {
            let reach = rng.random_range(0.3f64..1.0).powi(2) * FARTHEST;
            let at = direction(0.5 * PI + yaw + rng.random_range(-0.9..0.9), 0.0).as_dvec3() * reach;
            spots.push((at, false, weed_size * rng.random_range(0.4..1.1)));
        }
    }
    let camera_from_world = camera.world_from_camera.inverse();
    let margin = 0.25 * f64::from(size);
    let seen = |at: DVec3| {
        let ahead = camera_from_world.point(at + DVec3::Z * 0.1);
        let close = ahead.length() < 1.0;
        let inside = |x: f64| x > -margin && x < f64::from(size) + margin;
        close || intrinsics.project(ahead).is_some_and(|p| inside(p.x) && inside(p.y))
    };
    spots.retain(|(at, ..)| at.distance(eye) < FARTHEST && seen(*at));
    spots.sort_by(|a, b| a.0.distance(eye).total_cmp(&b.0.distance(eye)));
    let meshes = planted(eye, &spots, &bed, &weeds, rng);
    let mut setting = field(rng);
    if rng.random_bool(0.2) {
        // The machine's own shadow, or that of whoever walks beside it.
        setting.shade = Some(Shade {
            middle: eye.as_vec3() + Vec3::new(rng.random_range(-0.5..0.5), -0.4, 0.2),
            half: Vec3::new(rng.random_range(0.1..0.7), 0.3, rng.random_range(0.3..0.8)),
        });
    }
    Ok(Shot { scene: Scene::of_meshes(&meshes, setting, rng.random())?, camera, exposure: 0.22 })
}

/// Plants on the spots, the nearest first, as far as the triangles go. A spot is a place, whether it is the crop's, and a
/// size.
fn planted(eye: DVec3, spots: &[(DVec3, bool, f64)], crop: &Bed, weeds: &Bed, rng: &mut Seeded) -> Vec<StandingMesh> {
    let (mut meshes, mut triangles, mut organs) = (Vec::new(), 0, 0);
    for (at, of_crop, scale) in spots {
        let bed = if *of_crop { crop } else { weeds };
        if bed.plants.is_empty() {
            continue;
        }
        let plants = if at.distance(eye) > FAR { &bed.far } else { &bed.plants };
        let mesh = &plants[rng.random_range(0..plants.len())];
        triangles += mesh.faces.len();
        organs += mesh.organs.len();
        if triangles > TRIANGLES || organs > usize::from(u16::MAX) {
            break;
        }
        let turn = DQuat::from_rotation_z(rng.random_range(0.0..TAU));
        meshes.push(StandingMesh {
            mesh: Arc::clone(mesh),
            world_from_mesh: Pose::new(turn, *at),
            scale: *scale as f32,
        });
    }
    meshes
}

/// A few plants in a row or a patch, on soil or any other ground, from any side or above.
pub(super) fn close(nursery: &Nursery, size: u32, rng: &mut Seeded) -> Result<Shot, WorldError> {
    let wanted = if rng.random_bool(0.7) { Wanted::Broad } else { Wanted::Grass };
    let bed = nursery.bed(wanted, 3, rng)?;
    let weeds = nursery.bed(Wanted::Any, 2, rng)?;
    let height = f64::from(bed.height);
    let in_row = rng.random_bool(0.55);
    let count = if in_row { rng.random_range(3..9) } else { rng.random_range(1..7) };
    let spacing = rng.random_range(0.25..0.8) * height;
    let mut spots = Vec::new();
    for i in 0..count {
        let at = if in_row {
            DVec3::new(spacing * (f64::from(i) + rng.random_range(-0.15..0.15)), rng.random_range(-0.03..0.03), 0.0)
        } else {
            let radius = spacing * f64::from(i).sqrt();
            direction(rng.random_range(0.0..TAU), 0.0).as_dvec3() * radius
        };
        spots.push((at, true, rng.random_range(0.8..1.2)));
    }
    if rng.random_bool(0.3) {
        let weed_size = 0.4 * height / f64::from(weeds.height).max(0.02);
        for _ in 0..rng.random_range(1..8) {
            let at = DVec3::new(rng.random_range(-1.0..2.0) * spacing, rng.random_range(-1.0..1.0) * spacing, 0.0);
            spots.push((at, false, weed_size * rng.random_range(0.3..1.0)));
        }
    }
    let mut setting = field(rng);
    let sheet = rng.random_range(0..10);
    if sheet < 5 {
        let surface = match sheet {
            0 | 1 => Surface::Plain { colour: Vec3::splat(rng.random_range(0.0f32..0.95).powi(2)) },
            2 => Surface::Papers { size: height as f32 * rng.random_range(0.6f32..2.0) },
            _ => Surface::Clutter { size: height as f32 * rng.random_range(0.1f32..1.5) },
        };
        setting = Setting { ground: Ground { z: 0.0, surface }, light: daylight(rng), ..setting };
        if rng.random_bool(0.5) {
            setting.backdrop = Backdrop::Wall { distance: 4.0 * height + 3.0, surface };
        }
    }
    // As seen from where all are near.
    let meshes = planted(DVec3::ZERO, &spots, &bed, &weeds, rng);
    let scene = Scene::of_meshes(&meshes, setting, rng.random())?;
    let above = match rng.random_range(0..10) {
        0..4 => rng.random_range(1.3..1.57),
        4..8 => rng.random_range(0.2..0.8),
        _ => rng.random_range(0.8..1.3),
    };
    let from = direction(-0.5 * PI + rng.random_range(-0.6..0.6), above).as_dvec3();
    let fill = if in_row { rng.random_range(1.0..4.0) } else { rng.random_range(0.5..2.6) };
    let camera = aim(&scene, from, fill, size, rng);
    Ok(Shot { scene, camera, exposure: 0.22 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::species::shipped;
    use crate::world::{Sensor, render, seeded};

    #[test]
    fn the_horizon_is_where_field_of_view_pitch_and_roll_say() {
        let nursery = Nursery::new(vec![shipped("bean").expect("listed").expect("valid")]);
        let (mut skies, mut grounds) = (0, 0);
        for seed in 0..12 {
            let shot = rows(&nursery, 48, &mut seeded(seed)).expect("valid");
            let view = render(&shot.scene, &shot.camera, &Sensor::CLEAN, &mut seeded(seed));
            // What camera.f32 keeps, and nothing else.
            let (hfov, tilt) = (shot.camera.intrinsics.hfov(), shot.camera.tilt());
            let focal = 24.0 / (0.5 * hfov).tan();
            let (sin, cos) = tilt.pitch.sin_cos();
            for (x, y, instance) in view.instances.enumerate_pixels() {
                if instance.0[0] > 0 {
                    continue;
                }
                let (right, down) = ((f64::from(x) + 0.5 - 24.0) / focal, (f64::from(y) + 0.5 - 24.0) / focal);
                let upwards = right * tilt.roll.sin() - down * tilt.roll.cos();
                let height = (upwards * cos + sin).atan2((1.0 + right * right + down * down).sqrt());
                if view.depth.get_pixel(x, y).0[0] > 0.0 {
                    grounds += 1;
                    assert!(height < 0.0, "seed {seed}: ground at {x} {y}, {height} above the horizon");
                } else {
                    skies += 1;
                    // The ground ends 200 m away, half a degree below the horizon of a mast of 1.7 m.
                    assert!(height > -0.01, "seed {seed}: sky at {x} {y}, {height} below the horizon");
                }
            }
        }
        assert!(skies > 500 && grounds > 5000, "{skies} {grounds}");
    }
}
