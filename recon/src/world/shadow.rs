use glam::{Vec2, Vec3};

use super::raster::{Buffer, NONE};
use super::scene::Scene;

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
        let seen = |p: Vec3| ((flat(&p) - low) * texels_per_metre).extend(p.dot(to_sun));
        for (n, face) in scene.faces.iter().enumerate() {
            let corners = face.map(|v| seen(scene.positions[v as usize]));
            match scene.cutout(n) {
                None => heights.fill(corners, n as u32),
                Some(cutout) => heights.fill_cut(corners, n as u32, cutout),
            }
        }
        if let Some(shade) = scene.setting.shade {
            for triangle in shade.triangles() {
                heights.fill(triangle.map(seen), NONE);
            }
        }
        Self { across, along, origin: low, texels_per_metre, heights: Some(heights) }
    }

    /// Share of the sun that reaches `p`, 0..=1, over four texels.
    pub(super) fn sunlight(&self, p: Vec3, to_sun: Vec3) -> f32 {
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
