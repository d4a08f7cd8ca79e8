use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::LabelledMesh;

/// A cylinder that narrows downwards; its filled top is 1 cm under the plant's base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pot {
    /// Radius of the rim, metres.
    pub radius: f64,
    /// Height, metres.
    pub height: f64,
    /// Linear reflectance.
    pub colour: Vec3,
    /// How much of it, from below, stands in a black holder, 0..=1.
    pub holder: f64,
}

/// Sides of a pot.
const SIDES: u32 = 24;

/// Linear reflectance of holders and of the filling.
pub(super) const HOLDER: Vec3 = Vec3::splat(0.015);
pub(super) const FILLING: Vec3 = Vec3::new(0.06, 0.045, 0.035);

impl Pot {
    /// The pot's surface around `at`; v of its texture coordinates is the height.
    pub(super) fn mesh(&self, at: Vec3) -> LabelledMesh {
        let mut mesh = LabelledMesh::default();
        let (r, h) = (self.radius as f32, self.height as f32);
        // Profile from the filling outwards, over the rim and down: radius, height, and the normal's radius and height.
        let profile = [
            (0.0, -0.01, 0.0, 1.0),
            (0.92 * r, -0.01, 0.0, 1.0),
            (0.92 * r, 0.01, -1.0, 0.0),
            (r, 0.01, 0.0, 1.0),
            (r, 0.0, 1.0, 0.0),
            (0.8 * r, -h, 1.0, 0.0),
        ];
        for (radius, z, out, up) in profile {
            for k in 0..SIDES {
                let (sin, cos) = (TAU * k as f32 / SIDES as f32).sin_cos();
                mesh.positions.push(at + Vec3::new(radius * cos, radius * sin, z));
                mesh.normals.push(Vec3::new(out * cos, out * sin, up));
                mesh.uvs.push(Vec2::new(radius, z));
            }
        }
        for ring in 0..profile.len() as u32 - 1 {
            for k in 0..SIDES {
                let (a, b) = (ring * SIDES + k, ring * SIDES + (k + 1) % SIDES);
                mesh.faces.extend([[a, a + SIDES, b + SIDES], [a, b + SIDES, b]]);
            }
        }
        mesh
    }

    /// Linear reflectance where the texture coordinates are `uv`.
    pub(super) fn colour_at(&self, uv: Vec2) -> Vec3 {
        if uv.y < -(self.height * (1.0 - self.holder)) as f32 {
            HOLDER
        } else if uv.x < 0.915 * self.radius as f32 && uv.y > -0.0101 {
            FILLING
        } else {
            self.colour
        }
    }
}
