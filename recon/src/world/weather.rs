use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rand::Rng;

use super::Seeded;

/// A sun and the light from everywhere else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector to the sun.
    pub to_sun: Vec3,
    /// Linear colour of the sun.
    pub sun: Vec3,
    /// Linear colour of the rest.
    pub ambient: Vec3,
}

/// A box between the sun and the plants that the camera does not see: the machine that carries it, a person, a post.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shade {
    /// Its middle, metres.
    pub middle: Vec3,
    /// Half its sides along x, y and z, metres.
    pub half: Vec3,
}

impl Shade {
    /// Its twelve triangles.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> {
        let Self { middle, half } = *self;
        [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(move |axis| {
            let (u, v) = (Vec3::new(axis.y, axis.z, axis.x), Vec3::new(axis.z, axis.x, axis.y));
            [-1.0, 1.0].into_iter().flat_map(move |side| {
                let corner = move |i: f32, j: f32| middle + half * (axis * side + u * i + v * j);
                let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
                [[a, b, c], [a, c, d]]
            })
        })
    }
}

/// From a clear noon to an overcast day.
pub(super) fn daylight(rng: &mut Seeded) -> Light {
    // Half of the days are clear.
    let cloud: f32 = if rng.random_bool(0.5) { rng.random() } else { 0.3 * rng.random::<f32>() };
    let warm = Vec3::new(1.0, rng.random_range(0.85..0.97), rng.random_range(0.7..0.92));
    Light {
        to_sun: direction(rng.random_range(0.0..TAU), rng.random_range(0.2..1.4)),
        sun: warm * (3.2 * (1.0 - cloud * cloud)),
        ambient: Vec3::new(0.8, 0.9, 1.0) * (0.45 + 0.5 * cloud),
    }
}

/// The unit vector at an azimuth and height above the horizon.
pub(super) fn direction(azimuth: f64, height: f64) -> Vec3 {
    let (sin, cos) = height.min(0.5 * PI).sin_cos();
    DVec3::new(azimuth.cos() * cos, azimuth.sin() * cos, sin).as_vec3()
}
