//! What is seen behind plants: ground, wall and sky.

use glam::{Vec2, Vec3};

use super::Surface;
use super::noise::{fractal, noise};
use super::scene::Scene;

/// What is seen above and behind the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Backdrop {
    /// Sky of this brightness, without depth.
    Sky {
        /// Linear brightness overhead.
        brightness: f32,
    },
    /// A vertical wall at y = `distance` that gives its own light, as the back of an imaging chamber does.
    Wall {
        /// Metres along +y.
        distance: f64,
        /// What it looks like.
        surface: Surface,
    },
}

/// Where a ray meets ground, wall or sky.
pub(super) struct Background {
    pub colour: Vec3,
    /// Along the ray in units of its direction, infinite for the sky.
    pub distance: f32,
}

/// How far along a ray from `eye` the ground lies; infinite when it goes up.
pub(super) fn ground_distance(scene: &Scene, eye: Vec3, ray: Vec3) -> f32 {
    let t = (scene.setting.ground.z as f32 - eye.z) / ray.z;
    if t > 0.0 { t } else { f32::INFINITY }
}

/// What a ray sees that meets no face.
pub(super) fn background(scene: &Scene, eye: Vec3, ray: Vec3) -> Background {
    let ground = ground_distance(scene, eye, ray);
    let light = &scene.setting.light;
    let wall = match scene.setting.backdrop {
        Backdrop::Sky { .. } => f32::INFINITY,
        Backdrop::Wall { distance, .. } => (distance as f32 - eye.y) / ray.y,
    };
    let wall = if wall > 0.0 { wall } else { f32::INFINITY };
    let outdoors = matches!(scene.setting.backdrop, Backdrop::Sky { .. });
    if ground <= wall && ground < 200.0 {
        let p = eye + ray * ground;
        let mut colour = scene.setting.ground.surface.colour(Vec2::new(p.x, p.y), scene.seed);
        if outdoors {
            // Beyond the field lie others.
            let far = ((ground - 15.0) / 40.0).clamp(0.0, 0.9);
            let other =
                Vec3::new(0.16, 0.17, 0.09).lerp(Vec3::new(0.08, 0.16, 0.04), noise(Vec2::splat(0.5), scene.seed));
            colour = colour.lerp(other, far);
        }
        let sun = scene.shadow.sunlight(p, light.to_sun) * light.to_sun.z.max(0.0);
        return Background { colour: colour * (light.ambient + light.sun * sun), distance: ground };
    }
    match scene.setting.backdrop {
        Backdrop::Wall { surface, .. } if wall.is_finite() => {
            let p = eye + ray * wall;
            // Brighter in the middle, where the lamps behind it are.
            let fade = 1.0 / (1.0 + 0.05 * Vec2::new(p.x, p.z - 0.5).length_squared());
            Background { colour: surface.colour(Vec2::new(p.x, p.z), scene.seed ^ 5) * fade, distance: wall }
        }
        _ => sky(scene, ray),
    }
}

fn sky(scene: &Scene, ray: Vec3) -> Background {
    let brightness = match scene.setting.backdrop {
        Backdrop::Sky { brightness } => brightness,
        Backdrop::Wall { .. } => 1.0,
    };
    let up = ray.normalize().z.max(0.0);
    // A line of trees and hedges on the horizon.
    let azimuth = ray.y.atan2(ray.x);
    let trees = fractal(Vec2::new(azimuth * 25.0, 0.5), 3, scene.seed ^ 8) * 0.12 - 0.04;
    if up < trees {
        let leaves = fractal(Vec2::new(azimuth, up) * 90.0, 2, scene.seed ^ 9);
        return Background { colour: Vec3::new(0.05, 0.08, 0.04) * (0.5 + leaves), distance: f32::INFINITY };
    }
    let clouds = noise(Vec2::new(ray.x, ray.y) * 3.0 / (ray.z.abs() + 0.3), scene.seed ^ 6);
    let colour = Vec3::new(0.75, 0.82, 0.9).lerp(Vec3::new(0.32, 0.5, 0.85), up * (1.0 - 0.7 * clouds));
    Background { colour: colour * brightness, distance: f32::INFINITY }
}
