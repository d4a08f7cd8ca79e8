//! Soybean: trifoliate leaves on petioles, alternate on the main stem and on branches of old plants.

use std::f64::consts::PI;

use rand::Rng;

use super::Seeded;
use super::sprout::{
    Sprout, bend_spread, bent_stem, blade_frame, coefficients, drooping_blade, normal, scattered, stem_frame,
};
use crate::model::leaf::Blade;
use crate::model::{Habit, Plant, Species};

pub(super) fn grow(species: &Species, age: f64, rng: &mut Seeded) -> Plant {
    let mut sprout = Sprout::new(species);
    // V1 to about V16 (Fehr & Caviness, Stages of Soybean Development, 1977): nodes with trifoliate leaves. The
    // unifoliate pair below them, which falls early, is left out.
    let nodes = (1.0 + 13.0 * age.powf(1.1) + 0.7 * normal(rng)).round().clamp(1.0, 18.0) as usize;
    // Internodes of 3 to 6 cm below and 2 cm in the canopy (Lersten & Carlson 2004 give plants of 0.75 to 1.25 m).
    let height = (0.09 + 0.055 * (nodes as f64 - 1.0)) * (0.15 * normal(rng)).exp();
    let radius = (0.0014 + 0.0030 * age) * (0.12 * normal(rng)).exp();
    let lean = stem_frame(rng.random_range(0.0..2.0 * PI), 0.07 * normal(rng).abs());
    let main = sprout.stem(None, lean, height, radius, scattered(rng, bent_stem(species, 0.0), 0.3));
    let mut grower = Grower { species, age, leaf: 0 };
    let mut azimuth = rng.random_range(0.0..2.0 * PI);
    for i in 0..nodes {
        let up = (i as f64 + 1.0) / nodes as f64;
        let d = if nodes == 1 { 0.97 } else { 0.30 + 0.70 * (i as f64 / (nodes as f64 - 1.0)).powf(0.9) };
        // Alternate and nearly distichous (Lersten & Carlson 2004); the scatter of 20 degrees is a guess.
        azimuth += PI + 0.35 * normal(rng);
        // A young leaf at the top is half unfolded.
        let unfolded = if i + 1 == nodes { rng.random_range(0.35..0.8) } else { (2.2 - 1.3 * up).min(1.0) };
        grower.trifoliate(&mut sprout, (main, d), azimuth, unfolded, rng);
        // Branches rise from the lowest nodes of old plants (Lersten & Carlson 2004); how many is a guess.
        if age > 0.5 && i < 4 && rng.random::<f64>() < age - 0.4 {
            let length = height * rng.random_range(0.3..0.6);
            let base = stem_frame(azimuth + 0.3 * normal(rng), rng.random_range(0.5..0.9));
            // Branches bend upwards.
            let gamma = scattered(rng, bent_stem(species, -0.5), 0.4);
            let branch = sprout.stem(Some((main, d)), base, length, radius * 0.6, gamma);
            for k in 0..rng.random_range(2..5u32) {
                let side = azimuth + 0.5 * PI + PI * f64::from(k % 2) + 0.4 * normal(rng);
                let d = (0.4 + 0.2 * f64::from(k)).min(1.0);
                grower.trifoliate(&mut sprout, (branch, d), side, rng.random_range(0.5..0.85), rng);
            }
        }
    }
    sprout.finish()
}

struct Grower<'a> {
    species: &'a Species,
    age: f64,
    leaf: u16,
}

impl Grower<'_> {
    /// One leaf: petiole, two lateral leaflets at its end, a rachis and the terminal leaflet.
    fn trifoliate(&mut self, sprout: &mut Sprout<'_>, seat: (usize, f64), azimuth: f64, size: f64, rng: &mut Seeded) {
        // Petioles 3 cm on a seedling to 25 cm, leaflets 4 to 14 cm (Lersten & Carlson 2004).
        let petiole_length = (0.035 + 0.16 * self.age) * size * (0.18 * normal(rng)).exp();
        let leaflet_length = (0.055 + 0.065 * self.age) * size.sqrt() * (0.1 * normal(rng)).exp();
        let petiole_radius = (0.0009 + 0.0008 * self.age) * size.sqrt();
        let tilt = (0.85 + 0.18 * normal(rng)).clamp(0.3, 1.3);
        let gamma = scattered(rng, bent_stem(self.species, 0.2), 0.4);
        let petiole = sprout.stem(Some(seat), stem_frame(azimuth, tilt), petiole_length, petiole_radius, gamma);
        // Pulvini turn leaflets towards the light: near horizontal, hanging a little, each at will (guess).
        let droop = 0.5 * PI + 0.2 + 0.2 * normal(rng);
        let leaf = self.leaf;
        self.leaf += 1;
        let mut end = (petiole, 1.0);
        if self.species.habit == Habit::Compound {
            for side in [-1.0, 1.0] {
                let away = azimuth + side * (1.25 + 0.15 * normal(rng));
                let base = blade_frame(away, droop + 0.15 * normal(rng), 0.25 * normal(rng));
                let length = leaflet_length * 0.92 * (0.05 * normal(rng)).exp();
                sprout.blade(Some(end), base, length, self.blade(rng), leaf);
            }
            let rachis_length = leaflet_length * rng.random_range(0.2..0.35);
            let base = stem_frame(azimuth, 0.5 * (tilt + 0.5 * PI));
            let gamma = scattered(rng, bent_stem(self.species, 0.0), 0.3);
            end = (sprout.stem(Some(end), base, rachis_length, petiole_radius * 0.8, gamma), 1.0);
        }
        let base = blade_frame(azimuth + 0.1 * normal(rng), droop + 0.15 * normal(rng), 0.25 * normal(rng));
        sprout.blade(Some(end), base, leaflet_length, self.blade(rng), leaf);
    }

    fn blade(&self, rng: &mut Seeded) -> Blade {
        // Leaflets arch down a little.
        let gamma = scattered(rng, drooping_blade(self.species, 0.3), bend_spread(self.species, 0.7));
        Blade { beta: coefficients(rng, self.species.leaf.shape.rank(), 0.8), gamma, width: 1.0 }
    }
}
