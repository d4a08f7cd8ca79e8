//! Maize: strap leaves in two ranks on one stalk.

use std::f64::consts::PI;

use rand::Rng;

use super::Seeded;
use super::sprout::{
    Sprout, bend_spread, bent_stem, blade_frame, coefficients, drooping_blade, normal, scattered, stem_frame,
};
use crate::model::leaf::Blade;
use crate::model::{Plant, Species};

pub(super) fn grow(species: &Species, age: f64, rng: &mut Seeded) -> Plant {
    let mut sprout = Sprout::new(species);
    // 12 to 18 leaves in all, stalks to 3 m (Kiesselbach, The Structure and Reproduction of Corn, 1949); the lowest
    // have died when the highest unfold, so fewer are seen at a time. The law in age is a guess.
    let leaves = (3.0 + 10.0 * age + 0.8 * normal(rng)).round().clamp(2.0, 16.0) as usize;
    let height = (0.09 + 1.75 * age.powf(1.25)) * (0.12 * normal(rng)).exp();
    let radius = (0.004 + 0.008 * age) * (0.12 * normal(rng)).exp();
    let lean = stem_frame(rng.random_range(0.0..2.0 * PI), 0.05 * normal(rng).abs());
    let gamma = scattered(rng, bent_stem(species, 0.0), 0.15 + 0.1 * age);
    let stalk = sprout.stem(None, lean, height, radius, gamma);

    // The longest blade stands at two thirds of the height (Kiesselbach); 30 cm on a seedling, near 1 m later.
    let longest = (0.30 + 0.60 * age.powf(0.8)) * (0.15 * normal(rng)).exp();
    let plane = rng.random_range(0.0..2.0 * PI);
    let drift = 0.05 * normal(rng);
    let width = (0.95 + 0.22 * normal(rng)).max(0.5);
    // Whole plants are erect or lax by genotype.
    let lax = normal(rng);
    for i in 0..leaves {
        let up = (i as f64 + 0.5) / leaves as f64;
        let d = (0.08 + 0.90 * up.powf(0.9) + 0.012 * normal(rng)).clamp(0.03, 1.0);
        // Distichous: each leaf opposite the last (Kiesselbach), with a scatter of 10 degrees and a slow drift (guess).
        let azimuth = plane + PI * (i % 2) as f64 + drift * i as f64 + 0.17 * normal(rng);
        let profile = 0.6 + 0.4 * (1.0 - ((up - 0.6) / 0.6).powi(2)).max(0.0);
        let length = longest * profile * (0.08 * normal(rng)).exp();
        // Leaf angles from the stalk: 15 degrees in the whorl to 50 below (guess within the published 10 to 60).
        let tilt = (0.85 - 0.6 * up + 0.08 * lax + 0.1 * normal(rng)).clamp(0.08, 1.3);
        // Long unfolded blades arch over by a right angle or more, the whorl's stand; the law in radians is a guess.
        let turn = (2.4 - 1.9 * up + 0.5 * lax + 0.5 * normal(rng)).clamp(-0.3, 2.9);
        let gamma = scattered(rng, drooping_blade(species, turn), bend_spread(species, 0.6));
        let blade = Blade {
            beta: coefficients(rng, species.leaf.shape.rank(), 0.8),
            gamma,
            width: species.ranges.blade_width.clamp(width * (0.1 * normal(rng)).exp()),
        };
        sprout.blade(Some((stalk, d)), blade_frame(azimuth, tilt, 0.15 * normal(rng)), length, blade, i as u16);
    }
    sprout.finish()
}
