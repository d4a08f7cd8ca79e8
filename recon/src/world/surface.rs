use glam::{Vec2, Vec3};

use super::noise::{fractal, hash, noise, pebble, unit};

/// What ground and walls look like; colours are linear reflectances, lengths metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// One colour with a faint large pattern.
    Plain {
        /// Its colour.
        colour: Vec3,
    },
    /// Crumbly earth with stones and straw.
    Soil {
        /// Its colour.
        colour: Vec3,
        /// Share of cells of 4 cm with a stone, 0..=1.
        stones: f32,
        /// Share of cells of 7 cm with a straw, 0..=1.
        straw: f32,
        /// Share of cells of 9 cm with a speck of green that is no plant, 0..=1.
        weeds: f32,
    },
    /// Things of many colours: what a network must learn to ignore.
    Clutter {
        /// Size of the things.
        size: f32,
    },
    /// Sheets of white paper and printed targets of black and white squares that lie over each other on a dark table.
    Papers {
        /// About half a sheet's length.
        size: f32,
    },
    /// The inside of an imaging chamber: a light panel in a dark frame between grey metal walls with seams.
    Chamber {
        /// Colour of the panel.
        colour: Vec3,
        /// Half the panel's width, metres.
        half_width: f32,
        /// Height of the panel's lower edge, metres; below it is a bench.
        bench: f32,
    },
}

impl Surface {
    /// The linear colour at `p` metres on the surface.
    pub(super) fn colour(&self, p: Vec2, seed: u32) -> Vec3 {
        match *self {
            Self::Plain { colour } => colour * (0.96 + 0.08 * noise(p * 2.0, seed)),
            Self::Soil { colour, stones, straw, weeds } => soil(p, colour, [stones, straw, weeds], seed),
            Self::Clutter { size } => clutter(p / size, seed),
            Self::Papers { size } => papers(p / size, seed),
            Self::Chamber { colour, half_width, bench } => chamber(p, colour, half_width, bench, seed),
        }
    }
}

fn chamber(p: Vec2, colour: Vec3, half_width: f32, bench: f32, seed: u32) -> Vec3 {
    let part = |k: i32| unit(hash(glam::IVec2::new(k, 0), seed));
    let metal = Vec3::new(0.95, 1.0, 0.94) * (0.1 + 0.6 * part(1)) * (0.85 + 0.3 * noise(p * 1.5, seed));
    let beyond = p.x.abs() - half_width;
    if p.y < bench {
        // The bench's edge and a rail on it are dark.
        let depth = bench - p.y;
        let dark = depth < 0.012 || (depth - 0.1 - 0.1 * part(2)).abs() < 0.008;
        return if dark { metal * 0.15 } else { colour * (0.4 + 0.4 * part(3)) };
    }
    if beyond < 0.0 {
        // Dimmer towards the frame.
        let edge = (1.0 + beyond / half_width.max(0.05)).max(0.0);
        return colour * (1.0 - 0.25 * edge.powi(4)) * (0.97 + 0.06 * noise(p * 1.5, seed));
    }
    let frame = 0.03 + 0.09 * part(4);
    if beyond < frame {
        return Vec3::splat(0.01 + 0.05 * part(5)) * (0.8 + 0.4 * noise(p * 3.0, seed));
    }
    // Upright seams and profiles, and slanting cross rails because side walls run towards the camera.
    let seam = ((beyond - frame) / (0.12 + 0.2 * part(6))).fract();
    let rail = ((p.y + 0.25 * beyond * (part(7) - 0.3)) / (0.5 + part(8))).fract();
    if rail < 0.03 {
        return metal * 0.12;
    }
    metal
        * if seam < 0.1 {
            0.25
        } else if seam < 0.2 {
            1.25
        } else {
            0.9
        }
}

/// Six sheets; the first that covers `p` lies on top.
fn papers(p: Vec2, seed: u32) -> Vec3 {
    for sheet in 0..6 {
        let part = |k: i32| unit(hash(glam::IVec2::new(sheet, k), seed ^ 31));
        let middle = Vec2::new(part(0), part(1)) * 4.0 - 2.0;
        let at = Vec2::from_angle(std::f32::consts::TAU * part(2)).rotate(p - middle);
        if at.x.abs() > 1.0 || at.y.abs() > 0.7 {
            continue;
        }
        let squares = (at / (0.05 + 0.25 * part(3))).floor().as_ivec2();
        let printed = part(4) < 0.4 && at.x.abs() < 0.9 && at.y.abs() < 0.6;
        let black = printed && hash(squares, seed ^ sheet as u32) & 1 == 0;
        return Vec3::new(1.0, 0.99, 0.97) * if black { 0.03 } else { 0.6 + 0.3 * part(5) };
    }
    Vec3::new(0.12, 0.09, 0.07) * (0.4 + fractal(p * 8.0, 3, seed))
}

fn soil(p: Vec2, colour: Vec3, [stones, straw, weeds]: [f32; 3], seed: u32) -> Vec3 {
    let crumbs = fractal(p * 40.0, 3, seed);
    let patches = noise(p * 3.0, seed ^ 1);
    // Clods are lighter on one side: their relief, lit from a direction of the seed's.
    let aside = Vec2::from_angle(std::f32::consts::TAU * unit(seed)) * 0.008;
    let clods = 8.0 + 20.0 * unit(seed.rotate_left(16));
    let relief = noise((p + aside) * clods, seed ^ 12) - noise((p - aside) * clods, seed ^ 12);
    let rough = unit(seed.rotate_left(8));
    let mut c = colour * (0.35 + crumbs + 0.3 * patches + 3.0 * rough * relief).max(0.12);
    if stones + weeds > 0.0 {
        // Warping makes stones and leaves of round pebbles.
        let warp = Vec2::new(noise(p * 55.0, seed ^ 11), crumbs) * 0.03;
        // Large ones are rarer.
        for (size, layer, share) in [(0.016, 13, stones), (0.04, 2, stones), (0.09, 14, stones * stones)] {
            let (inside, h) = pebble((p + warp * (size / 0.04)) / size, 1.0 + unit(seed ^ layer), share, seed ^ layer);
            if inside > 0.05 {
                let grey = 0.12 + 0.45 * unit(h.rotate_left(9));
                let lit = 0.8 + 1.2 * relief;
                c = Vec3::new(1.0, 0.96, 0.9) * grey * lit * (0.55 + 0.6 * inside.min(0.6) + 0.3 * crumbs);
            }
        }
        let (inside, h) = pebble((p + warp) / 0.09, 2.5, weeds, seed ^ 4);
        if inside > 0.45 {
            c = Vec3::new(0.10, 0.2, 0.05) * (0.4 + unit(h.rotate_left(5)));
        }
    }
    let (inside, h) = pebble(p / 0.07, 9.0, straw, seed ^ 3);
    if inside > 0.1 {
        c = Vec3::new(0.42, 0.33, 0.17) * (0.5 + unit(h.rotate_left(7)));
    }
    c
}

/// Overlapping flat things: the topmost pebble of several layers wins.
fn clutter(p: Vec2, seed: u32) -> Vec3 {
    let p = p + Vec2::new(noise(p * 2.5, seed ^ 21), noise(p * 2.5, seed ^ 22)) * 0.45;
    for layer in 0..3u32 {
        let stretch = 1.0 + 3.0 * unit(hash(glam::IVec2::new(layer as i32, 0), seed));
        let (inside, h) = pebble(p * (1.0 + 0.7 * layer as f32), stretch, 0.75, seed ^ (layer + 7));
        if inside > 0.0 {
            return tint(h) * (0.7 + 0.5 * fractal(p * 6.0, 2, h));
        }
    }
    tint(seed) * (0.7 + 0.6 * fractal(p, 3, seed))
}

/// A random linear colour, greys and browns more often than bright ones.
fn tint(h: u32) -> Vec3 {
    let part = |k: u32| unit(hash(glam::IVec2::new(h as i32, k as i32), 77));
    let grey = 0.02 + 0.8 * part(0) * part(0);
    let colour = Vec3::new(part(1), part(2), part(3)) * 0.8;
    Vec3::splat(grey).lerp(colour, part(4) * part(4))
}
