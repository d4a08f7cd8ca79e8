//! Light on organs: textures, veins, leaves that let light through, glints.

use demeter_frame::Semantic;
use glam::{Vec2, Vec3};

use super::look::Look;
use super::noise::noise;
use super::scene::Scene;

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
    let leaf = look.semantic == Semantic::Leaf;
    let upper = spot.normal.dot(spot.to_eye) >= 0.0;
    let mut normal = if upper { spot.normal } else { -spot.normal };
    let mut colour = match (&look.texture, scene.setting.pot) {
        (Some(texture), _) => {
            let tint = Vec3::ONE.lerp(look.colour / texture.mean().max(Vec3::splat(0.005)), look.recolour);
            texture.colour(spot.uv) * tint.min(Vec3::splat(4.0))
        }
        (None, Some(pot)) if look.semantic == Semantic::Background => pot.colour_at(spot.uv),
        (None, _) => look.colour * (0.88 + 0.24 * noise(spot.uv * Vec2::new(7.0, 19.0), look.seed)),
    };
    if leaf {
        if look.texture.is_none() {
            colour = veined(colour, look, spot.uv);
        }
        colour = aged(colour, look, spot.uv);
        if !upper {
            // Lower sides are paler.
            colour = colour.lerp(Vec3::new(0.16, 0.24, 0.10), 0.35);
        }
        let bump = |k: u32| noise(spot.uv * Vec2::new(9.0, 14.0), look.seed ^ k) - 0.5;
        normal = (normal + Vec3::new(bump(21), bump(22), bump(23)) * (2.0 * look.crinkle)).normalize_or(normal);
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
    let glint = normal.dot(half).max(0.0).powf(look.polish);
    // Wax mirrors the sky at grazing angles (Schlick 1994), which makes leaves look grey-blue there.
    let sheen = (1.0 - normal.dot(spot.to_eye).abs()).powi(5) + 0.04;
    out + light.sun * (look.gloss * sun * glint) + light.ambient * (1.5 * look.gloss * sheen)
}

/// The midrib and side veins of a blade without a picture.
fn veined(colour: Vec3, look: &Look, uv: Vec2) -> Vec3 {
    let off = (uv.x - 0.5).abs();
    // The midrib, then side veins that leave it forwards.
    let midrib = (1.0 - off / 0.035).max(0.0);
    let side = ((uv.y - 0.9 * off) * 9.0).fract();
    let side = (1.0 - (side - 0.5).abs() / 0.09).max(0.0) * 0.35;
    let veins = look.vein * (midrib + side).min(1.0);
    colour.lerp(colour * 1.7 + Vec3::new(0.05, 0.06, 0.02), veins)
}

/// Old leaves: yellow from the tip on and in patches, then brown.
fn aged(mut colour: Vec3, look: &Look, uv: Vec2) -> Vec3 {
    if look.yellow > 0.0 {
        let patch = noise(uv * Vec2::new(4.0, 6.0), look.seed ^ 9) * 0.7 + 0.5 * uv.y;
        colour = colour.lerp(Vec3::new(0.42, 0.36, 0.08), (look.yellow * 2.0 * patch).min(1.0));
        // What is quite yellow dries to brown.
        colour = colour.lerp(Vec3::new(0.3, 0.21, 0.11), (look.yellow * 4.0 * patch - 1.6).clamp(0.0, 1.0));
    }
    colour
}
