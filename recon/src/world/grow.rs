use super::{Seeded, maize, soybean};
use crate::model::{Habit, Plant, Species};

/// A random plant of a species at `age` (0 = the first true leaf, 1 = full height), standing at the world's origin.
/// Ages outside 0..=1 count as the nearest end.
#[must_use]
pub fn grow(species: &Species, age: f64, rng: &mut Seeded) -> Plant {
    // Written so that NaN counts as 0.
    let age = if age > 0.0 { age.min(1.0) } else { 0.0 };
    match species.habit {
        Habit::Grass => maize::grow(species, age, rng),
        Habit::Simple | Habit::Compound => soybean::grow(species, age, rng),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Detail, Form, Knots, PlantMesh, forward};
    use crate::species::{NAMES, shipped};
    use crate::world::seeded;

    #[test]
    fn plants_of_every_age_are_valid_and_have_plausible_sizes() {
        for name in NAMES {
            let species = shipped(name).expect("listed").expect("valid");
            for seed in 0..200 {
                let age = f64::from(seed as u32) / 199.0;
                let plant = grow(&species, age, &mut seeded(seed));
                let posed = forward(&plant, &species).expect("valid");
                let mesh = PlantMesh::of(&posed, Detail::Coarse, Knots::Uniform);
                let height = mesh.positions.iter().map(|p| p.z).fold(0.0, f64::max);
                let blades = plant.organs.iter().filter(|o| matches!(o.form, Form::Leaf { .. })).count();
                assert!((0.05..3.5).contains(&height), "{name} {seed}: height {height}");
                assert!((1..=250).contains(&blades), "{name} {seed}: {blades} blades");
                assert!(mesh.positions.iter().all(|p| p.is_finite()), "{name} {seed}");
                for (organ, at) in plant.organs.iter().zip(&posed.world_from_organ) {
                    let range = match organ.form {
                        Form::Stem { .. } => species.ranges.stem_length,
                        Form::Leaf { .. } => species.ranges.blade_length,
                    };
                    assert!(at.scale > range.min * 0.999 && at.scale < range.max * 1.001, "{name} {seed}");
                }
            }
        }
    }

    #[test]
    fn older_plants_are_taller_and_seeds_matter() {
        for name in NAMES {
            let species = shipped(name).expect("listed").expect("valid");
            let length = |age, seed| grow(&species, age, &mut seeded(seed)).organs[0].joint.scale;
            assert!((0..20).all(|seed| length(0.1, seed) < length(0.9, seed)), "{name}");
            assert_ne!(grow(&species, 0.5, &mut seeded(1)), grow(&species, 0.5, &mut seeded(2)));
            assert_eq!(grow(&species, 0.5, &mut seeded(1)), grow(&species, 0.5, &mut seeded(1)));
        }
    }
}
