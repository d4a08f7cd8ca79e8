//! Light: shadows, leaves that let light through, ground, wall and sky.

use glam::{Vec2, Vec3};

use super::raster::Buffer;
use super::scene::{Backdrop, Look, Scene};
use super::texture::noise;
use demeter_frame::Semantic;

/// Side of the shadow map, texels.
const SHADOW_SIDE: usize = 1024;

/// How high towards the sun the first thing stands, over a square grid across the light.
pub(super) struct Shadow {
    across: Vec3,
    along: Vec3,
    origin: Vec2,
    texels_per_metre: f32,
    heights: Option<Buffer>,
}

impl Shadow {
    pub(super) fn none() -> Self {
        Self { across: Vec3::X, along: Vec3::Y, origin: Vec2::ZERO, texels_per_metre: 1.0, heights: None }
    }

    /// The shadow map of everything that stands in the scene.
    pub(super) fn cast(scene: &Scene) -> Self {
        let to_sun = scene.setting.light.to_sun;
        let across = to_sun.any_orthonormal_vector();
        let along = to_sun.cross(across);
        let flat = |p: &Vec3| Vec2::new(p.dot(across), p.dot(along));
        let Some(first) = scene.positions.first().map(flat) else {
            return Self::none();
        };
        let (low, high) =
            scene.positions.iter().map(flat).fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
        let texels_per_metre = SHADOW_SIDE as f32 / (high - low).max_element().max(0.01);
        let mut heights = Buffer::new(SHADOW_SIDE, SHADOW_SIDE, f32::NEG_INFINITY);
        for (n, face) in scene.faces.iter().enumerate() {
            let corners = face.map(|v| {
                let p = scene.positions[v as usize];
                ((flat(&p) - low) * texels_per_metre).extend(p.dot(to_sun))
            });
            heights.fill(corners, n as u32);
        }
        Self { across, along, origin: low, texels_per_metre, heights: Some(heights) }
    }

    /// Share of the sun that reaches `p`, 0..=1, over four texels.
    fn sunlight(&self, p: Vec3, to_sun: Vec3) -> f32 {
        let Some(map) = &self.heights else {
            return 1.0;
        };
        let at = (Vec2::new(p.dot(self.across), p.dot(self.along)) - self.origin) * self.texels_per_metre;
        // Two texels and 3 mm, so that no sheet shades itself.
        let height = p.dot(to_sun) + 0.003 + 2.0 / self.texels_per_metre;
        let mut lit = 0.0;
        for (dx, dy) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
            let (x, y) = ((at.x + dx).floor(), (at.y + dy).floor());
            let inside = x >= 0.0 && y >= 0.0 && x < SHADOW_SIDE as f32 && y < SHADOW_SIDE as f32;
            let shaded = inside && map.key[y as usize * SHADOW_SIDE + x as usize] > height;
            lit += if shaded { 0.0 } else { 0.25 };
        }
        lit
    }
}

/// A point of an organ or a pot.
pub(super) struct Spot {
    pub position: Vec3,
    pub normal: Vec3,
    pub uv: Vec2,
    /// Unit vector to the camera.
    pub to_eye: Vec3,
}

/// The light that an organ or pot sends to the eye.
pub(super) fn organ(scene: &Scene, look: &Look, spot: &Spot) -> Vec3 {
    let light = &scene.setting.light;
    let upper = spot.normal.dot(spot.to_eye) >= 0.0;
    let normal = if upper { spot.normal } else { -spot.normal };
    let mut colour = look.colour * (0.88 + 0.24 * noise(spot.uv * Vec2::new(7.0, 19.0), look.seed));
    let leaf = look.semantic == Semantic::Leaf;
    if leaf {
        colour = leaf_colour(colour, look, spot.uv);
        if !upper {
            // Lower sides are paler.
            colour = colour.lerp(Vec3::new(0.16, 0.24, 0.10), 0.35);
        }
    }
    let sun = scene.shadow.sunlight(spot.position, light.to_sun);
    let facing = normal.dot(light.to_sun);
    // Open sky above, darker below and near the ground between plants.
    let sky = light.ambient * (0.62 + 0.38 * normal.z) * (0.6 + 0.4 * (spot.position.z * 4.0).clamp(0.0, 1.0));
    let mut out = colour * (sky + light.sun * (sun * facing.max(0.0)));
    if leaf && facing < 0.0 {
        // What passes through a blade is yellower than what it reflects.
        out += colour * Vec3::new(0.95, 0.85, 0.35) * light.sun * (sun * -facing * 0.55);
    }
    let half = (light.to_sun + spot.to_eye).normalize_or_zero();
    let glint = normal.dot(half).max(0.0).powi(24);
    out + light.sun * (look.gloss * sun * glint)
}

fn leaf_colour(colour: Vec3, look: &Look, uv: Vec2) -> Vec3 {
    let off = (uv.x - 0.5).abs();
    // The midrib, then side veins that leave it forwards.
    let midrib = (1.0 - off / 0.035).max(0.0);
    let side = ((uv.y - 0.9 * off) * 9.0).fract();
    let side = (1.0 - (side - 0.5).abs() / 0.09).max(0.0) * 0.35;
    let veins = look.vein * (midrib + side).min(1.0);
    let mut colour = colour.lerp(colour * 1.7 + Vec3::new(0.05, 0.06, 0.02), veins);
    if look.yellow > 0.0 {
        let patch = noise(uv * Vec2::new(4.0, 6.0), look.seed ^ 9) * 0.7 + 0.5 * uv.y;
        colour = colour.lerp(Vec3::new(0.42, 0.36, 0.08), (look.yellow * 2.0 * patch).min(1.0));
        // What is quite yellow dries to brown.
        colour = colour.lerp(Vec3::new(0.3, 0.21, 0.11), (look.yellow * 4.0 * patch - 1.6).clamp(0.0, 1.0));
    }
    colour
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
    if ground <= wall && ground < 200.0 {
        let p = eye + ray * ground;
        let colour = scene.setting.ground.surface.colour(Vec2::new(p.x, p.y), scene.seed);
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
    let clouds = noise(Vec2::new(ray.x, ray.y) * 3.0 / (ray.z.abs() + 0.3), scene.seed ^ 6);
    let colour = Vec3::new(0.75, 0.82, 0.9).lerp(Vec3::new(0.32, 0.5, 0.85), up * (1.0 - 0.7 * clouds));
    Background { colour: colour * brightness, distance: f32::INFINITY }
}
