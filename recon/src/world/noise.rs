//! Procedural noise on integer lattices: the same on every machine.

use glam::{IVec2, Vec2};

/// A well-mixed hash of a lattice point (the finaliser of MurmurHash3).
pub(super) fn hash(at: IVec2, seed: u32) -> u32 {
    let mut h =
        seed ^ (at.x as u32).wrapping_mul(0x9E37_79B1) ^ (at.y as u32).wrapping_mul(0x85EB_CA77).rotate_left(13);
    h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
    h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
    h ^ (h >> 16)
}

/// A hash as a number in 0..1.
pub(super) fn unit(h: u32) -> f32 {
    (h >> 8) as f32 / 16_777_216.0
}

/// Smooth value noise in 0..1 with features of size 1.
pub(super) fn noise(p: Vec2, seed: u32) -> f32 {
    let cell = p.floor();
    let t = p - cell;
    let t = t * t * (3.0 - 2.0 * t);
    let at = cell.as_ivec2();
    let value = |x, y| unit(hash(at.wrapping_add(IVec2::new(x, y)), seed));
    let low = value(0, 0) + (value(1, 0) - value(0, 0)) * t.x;
    let high = value(0, 1) + (value(1, 1) - value(0, 1)) * t.x;
    low + (high - low) * t.y
}

/// Value noise summed over octaves, in 0..1.
pub(super) fn fractal(p: Vec2, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut p) = (0.0, 0.5, 0.0, p);
    for octave in 0..octaves {
        sum += weight * noise(p, seed.wrapping_add(octave));
        total += weight;
        weight *= 0.5;
        p *= 2.1;
    }
    sum / total
}

/// One pebble in each cell of size 1: how far inside it `p` lies (0 outside .. 1 at its middle) and its number.
/// `stretch` > 1 makes it a straw in a random direction; `share` of the cells hold one.
pub(super) fn pebble(p: Vec2, stretch: f32, share: f32, seed: u32) -> (f32, u32) {
    let cell = p.floor();
    let h = hash(cell.as_ivec2(), seed);
    if unit(h) >= share {
        return (0.0, h);
    }
    let random = |k: u32| unit(hash(IVec2::new(h as i32, k as i32), seed));
    let radius = 0.12 + 0.3 * random(1) * random(1);
    let middle = Vec2::new(0.5, 0.5) + (Vec2::new(random(2), random(3)) - 0.5) * (1.0 - 2.0 * radius);
    let at = Vec2::from_angle(random(4) * std::f32::consts::TAU).rotate(p - cell - middle);
    let distance = Vec2::new(at.x, at.y * stretch).length() / radius;
    ((1.0 - distance).max(0.0), h)
}
