//! Single plants in pots: labs and imaging chambers.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use demeter_frame::Pose;
use glam::{DQuat, DVec3, Vec3};
use rand::Rng;

use super::nursery::Wanted;
use super::training::{Shot, aim};
use super::weather::direction;
use super::{Backdrop, Ground, Light, Nursery, Pot, Scene, Seeded, Setting, StandingMesh, Surface, WorldError};

/// One potted plant before a wall or in a chamber, mostly from the side.
pub(super) fn potted(nursery: &Nursery, wanted: Wanted, size: u32, rng: &mut Seeded) -> Result<Shot, WorldError> {
    let bed = nursery.bed(wanted, 1, rng)?;
    let turn = DQuat::from_rotation_z(rng.random_range(0.0..TAU));
    let standing = |mesh: &Arc<_>| StandingMesh {
        mesh: Arc::clone(mesh),
        world_from_mesh: Pose::new(turn, DVec3::ZERO),
        scale: 1.0,
    };
    let mut meshes: Vec<StandingMesh> = bed.plants.iter().take(1).map(standing).collect();
    let bolting = wanted == Wanted::Broad && rng.random_bool(0.15);
    if let (true, Some((rosette, height)), Some(stalk)) = (bolting, nursery.rosette(rng), meshes.first_mut()) {
        // A rosette with a leafless stalk, whose petioles pass for pods.
        stalk.mesh = Arc::new(stalk.mesh.leafless());
        let scale = bed.height * rng.random_range(0.08..0.3) / height.max(0.02);
        meshes.push(StandingMesh { scale, ..standing(&rosette) });
    }
    let radius = rng.random_range(0.05..0.16);
    let pot = Pot {
        radius,
        height: radius * rng.random_range(1.2..2.2),
        colour: Vec3::splat(if rng.random_bool(0.4) {
            rng.random_range(0.5..1.2)
        } else {
            rng.random_range(0.02..0.9)
        }) * Vec3::new(1.0, rng.random_range(0.8..1.0), rng.random_range(0.7..1.0)),
        holder: if rng.random_bool(0.3) { rng.random_range(0.1..0.7) } else { 0.0 },
    };
    let pale = Vec3::new(1.0, rng.random_range(0.92..1.02), rng.random_range(0.8..1.02));
    let (surface, exposure) = match rng.random_range(0..20) {
        0..8 => (Surface::Plain { colour: pale * rng.random_range(0.8f32..1.4) }, 0.78),
        8..14 => {
            let bench = -(pot.height as f32) - rng.random_range(0.0f32..0.1);
            let half_width = rng.random_range(0.3..0.9) * (0.5 + 0.5 * bed.height);
            let colour = pale * rng.random_range(0.8..1.8);
            (Surface::Chamber { colour, half_width, bench }, rng.random_range(0.45..0.7))
        }
        14..16 => (Surface::Plain { colour: pale * rng.random_range(0.05f32..0.6) }, 0.35),
        // Black cloth.
        16..18 => (Surface::Plain { colour: Vec3::splat(rng.random_range(0.0f32..0.2).powi(2)) }, 0.06),
        _ => (Surface::Clutter { size: rng.random_range(0.05f32..0.6) }, 0.3),
    };
    // Crops of imaging chambers show no floor; a chamber's bench is on its wall.
    let hidden = matches!(surface, Surface::Chamber { .. }) || rng.random_bool(0.75);
    let pot = rng.random_bool(0.8).then_some(pot);
    let floor = if hidden { -4.0 } else { -pot.map_or(0.02, |pot| pot.height) - rng.random_range(0.0..0.4) };
    // Lamps behind the wall leave the plant dark, lamps in front do not.
    let lamp = rng.random_range(0.0f32..0.9);
    let ambient = rng.random_range(0.25f32..0.95).powi(2);
    let setting = Setting {
        ground: Ground { z: floor, surface: Surface::Plain { colour: Vec3::splat(rng.random_range(0.1..0.8)) } },
        backdrop: Backdrop::Wall { distance: 1.5, surface },
        pot,
        light: Light {
            to_sun: direction(rng.random_range(0.0..TAU), rng.random_range(0.2..1.4)),
            sun: Vec3::new(1.0, 0.97, 0.9) * lamp,
            ambient: Vec3::splat(ambient),
        },
        shade: None,
    };
    let scene = Scene::of_meshes(&meshes, setting, rng.random())?;
    let above = if rng.random_bool(0.8) { rng.random_range(-0.15..0.2) } else { rng.random_range(0.2..0.9) };
    let from = direction(-0.5 * PI + rng.random_range(-0.1..0.1), above).as_dvec3();
    let fill = match rng.random_range(0..20) {
        // Leaves leave the picture; the whole plant is small in it; it just fits.
        0..5 => rng.random_range(1.2..2.4),
        5..10 => rng.random_range(0.25..0.7),
        _ => rng.random_range(0.85..1.2),
    };
    let camera = aim(&scene, from, fill, size, rng);
    Ok(Shot { scene, camera, exposure })
}
