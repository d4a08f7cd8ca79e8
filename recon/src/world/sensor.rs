use demeter_frame::Rgb;
use glam::{Vec2, Vec3};
use rand::Rng;

use super::Seeded;

/// What a camera does to light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Rays a pixel along each side: 1 is fast, 2 shows thin stems as a camera does.
    pub samples: u32,
    /// Mean linear brightness that automatic exposure brings the picture to.
    pub exposure: f32,
    /// Gain of red, green and blue.
    pub white_balance: Vec3,
    /// Standard deviation of the lens blur, pixels; 0 for none.
    pub blur: f32,
    /// How far the picture moves while it is taken, pixels right and down.
    pub smear: Vec2,
    /// How much darker its corners are than its middle, 0..=1.
    pub vignette: f32,
    /// Light scattered in the lens.
    pub flare: Option<Flare>,
    /// Noise of a pixel at full brightness, linear (photon noise; falls with the root of brightness).
    pub shot_noise: f32,
    /// Noise in the dark, linear.
    pub read_noise: f32,
}

/// A lamp or the sun in or beside the picture, whose light the lens scatters over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flare {
    /// Where, in widths of the picture from its upper left corner.
    pub at: Vec2,
    /// Linear colour where it is strongest, times the picture's mean brightness.
    pub colour: Vec3,
    /// How far it reaches, widths of the picture.
    pub reach: f32,
}

impl Sensor {
    /// A clean camera: no blur, no noise.
    pub const CLEAN: Self = Self {
        samples: 1,
        exposure: 0.22,
        white_balance: Vec3::ONE,
        blur: 0.0,
        smear: Vec2::ZERO,
        vignette: 0.0,
        flare: None,
        shot_noise: 0.0,
        read_noise: 0.0,
    };

    /// A day-light camera with the faults that cameras have.
    pub const FIELD: Self = Self { blur: 0.5, shot_noise: 0.015, read_noise: 0.003, ..Self::CLEAN };

    /// Turns linear light, row-major, into 8-bit sRGB. A `light` of another size than `width * height` gives black.
    #[must_use]
    pub fn expose(&self, light: &[Vec3], width: u32, height: u32, rng: &mut Seeded) -> Rgb {
        let mut light = light.to_vec();
        light.resize(width as usize * height as usize, Vec3::ZERO);
        blur(&mut light, width as usize, self.blur);
        smear(&mut light, width as usize, self.smear);
        self.scatter(&mut light, width as usize);
        // Highlights count at most fourfold, as in a camera's metering.
        let mean = light.iter().map(|c| c.element_sum().min(4.0) / 3.0).sum::<f32>() / light.len().max(1) as f32;
        let gain = self.white_balance * (self.exposure / mean.max(1e-4)).min(HIGHEST_GAIN);
        let noisy = self.shot_noise > 0.0 || self.read_noise > 0.0;
        let encode = srgb_table();
        let mut bytes = Vec::with_capacity(light.len() * 3);
        for c in light {
            for mut x in (c * gain).to_array() {
                if noisy {
                    x += bell(rng) * (self.read_noise + self.shot_noise * x.clamp(0.0, 1.0).sqrt());
                }
                bytes.push(encode[(x.clamp(0.0, 1.0) * STEPS + 0.5) as usize]);
            }
        }
        Rgb::from_raw(width, height, bytes).unwrap_or_default()
    }

    /// Darkens the corners and adds the flare.
    fn scatter(&self, light: &mut [Vec3], width: usize) {
        if self.vignette <= 0.0 && self.flare.is_none() {
            return;
        }
        let mean = light.iter().sum::<Vec3>() / light.len().max(1) as f32;
        let shape = Vec2::new(1.0, (light.len() / width.max(1)) as f32 / width.max(1) as f32);
        for (n, c) in light.iter_mut().enumerate() {
            let at = Vec2::new((n % width) as f32, (n / width) as f32) / width as f32;
            let off = (at - shape * 0.5).length_squared() / (0.25 * shape.length_squared());
            *c *= 1.0 - self.vignette * off;
            if let Some(flare) = self.flare {
                *c += flare.colour * mean * (-(at - flare.at).length_squared() / (flare.reach * flare.reach)).exp();
            }
        }
    }
}

/// Exposure times and amplifiers end somewhere: a plant before black cloth stays a plant.
const HIGHEST_GAIN: f32 = 6.0;

/// Averages along the way that the picture moves.
fn smear(light: &mut Vec<Vec3>, width: usize, way: Vec2) {
    /// Longest way, pixels: more is no picture.
    const LONGEST: f32 = 16.0;
    let steps = way.length().min(LONGEST).round() as i32;
    if steps < 1 || width == 0 {
        return;
    }
    let height = light.len() / width;
    let way = way.clamp_length_max(LONGEST);
    let at = |x: usize, y: usize, k: i32| {
        let moved = Vec2::new(x as f32, y as f32) + way * (k as f32 / steps as f32 - 0.5) + 0.5;
        let (x, y) = ((moved.x.max(0.0) as usize).min(width - 1), (moved.y.max(0.0) as usize).min(height - 1));
        light[y * width + x]
    };
    let mean = |n: usize| (0..=steps).map(|k| at(n % width, n / width, k)).sum::<Vec3>() / (steps + 1) as f32;
    *light = (0..light.len()).map(mean).collect();
}

/// Nearly normal noise of standard deviation 1 out of one draw: four bytes summed.
fn bell(rng: &mut Seeded) -> f32 {
    let sum: u32 = rng.random::<u32>().to_le_bytes().iter().map(|b| u32::from(*b)).sum();
    // Four uniform bytes have mean 510 and variance 4 (256² - 1) / 12.
    (sum as f32 - 510.0) / 147.8
}

/// Steps of the encoding table: the darkest are 0.8 of an 8-bit level apart.
const STEPS: f32 = 4095.0;

/// sRGB's encoding (IEC 61966-2-1) of 0..=1, as a table because a power a channel is what exposing would cost.
fn srgb_table() -> Vec<u8> {
    let encode = |x: f32| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (0..=STEPS as u32).map(|i| (encode(i as f32 / STEPS) * 255.0 + 0.5) as u8).collect()
}

/// A separable Gaussian of at most 9 taps.
fn blur(light: &mut [Vec3], width: usize, sigma: f32) {
    if sigma.is_nan() || sigma <= 0.05 || width == 0 {
        return;
    }
    let reach = ((2.5 * sigma).ceil() as usize).min(4);
    let weight = |k: usize| (-0.5 * (k as f32 / sigma).powi(2)).exp();
    let total: f32 = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f32>();
    let weights: Vec<f32> = (0..=reach).map(|k| weight(k) / total).collect();
    let height = light.len() / width;
    let mut pass = |count: usize, length: usize, index: &dyn Fn(usize, usize) -> usize| {
        let mut line = vec![Vec3::ZERO; length];
        for i in 0..count {
            for (j, out) in line.iter_mut().enumerate() {
                *out = light[index(i, j)];
            }
            for j in 0..length {
                let mut sum = line[j] * weights[0];
                for (k, w) in weights.iter().enumerate().skip(1) {
                    sum += (line[j.saturating_sub(k)] + line[(j + k).min(length - 1)]) * *w;
                }
                light[index(i, j)] = sum;
            }
        }
    };
    pass(height, width, &|i, j| i * width + j);
    pass(width, height, &|i, j| j * width + i);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::seeded;

    #[test]
    fn exposure_ignores_the_lamp_and_blur_keeps_the_mean() {
        let light: Vec<Vec3> = (0..64 * 64).map(|i| Vec3::splat((i % 64) as f32 / 64.0)).collect();
        let bright: Vec<Vec3> = light.iter().map(|c| c * 0.25).collect();
        let expose = |light: &[Vec3]| Sensor::CLEAN.expose(light, 64, 64, &mut seeded(1));
        assert_eq!(expose(&light), expose(&bright));
        let mut blurred = light.clone();
        blur(&mut blurred, 64, 1.0);
        let mean = |light: &[Vec3]| light.iter().map(|c| c.x).sum::<f32>() / light.len() as f32;
        assert!((mean(&light) - mean(&blurred)).abs() < 1e-3);
        let mut moved = light.clone();
        smear(&mut moved, 64, Vec2::new(0.0, 9.0));
        assert!(moved.iter().zip(&light).all(|(a, b)| (*a - *b).length() < 1e-5), "along the stripes nothing changes");
        smear(&mut moved, 64, Vec2::new(9.0, 0.0));
        assert!((mean(&light) - mean(&moved)).abs() < 1e-2 && moved != light);
        let table = srgb_table();
        assert_eq!([table[0], table[4095]], [0, 255]);
        // 18 % grey is 118 in sRGB.
        assert_eq!(table[(0.18 * STEPS) as usize], 118);
    }
}
