//! What the tests of this crate share.

use std::path::PathBuf;

use demeter_frame::Pose;
use demeter_recon::model::leaf::Blade;
use demeter_recon::model::{Form, Habit, Joint, Organ, Plant, Species};
use glam::{DQuat, DVec3};
use proptest::test_runner::Config as ProptestConfig;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Few enough cases for a quick run; failures print their input instead of leaving a file.
pub(crate) fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// A file of the shared data, or `None` after saying that the test named `test` is skipped.
pub(crate) fn shared(test: &str, file: &str) -> Option<PathBuf> {
    let shared = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared"));
    if !shared.exists() {
        eprintln!("{test}: skipped, ../shared is absent");
        return None;
    }
    Some(shared.join("data").join(file))
}

pub(crate) fn species(name: &str) -> Species {
    demeter_recon::species::shipped(name).expect("listed").expect("valid")
}

/// The species as it is before anything is learned: its mean blade and stem are flat and straight.
pub(crate) fn flat(name: &str) -> Species {
    demeter_recon::species::generic(name).expect("listed").expect("valid")
}

/// A random plant of `organs` organs with plausible numbers that mean nothing botanically: any tree, any turn.
pub(crate) fn random_plant(species: &Species, organs: usize, seed: u64) -> Plant {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut plant = Plant { world_from_plant: pose(&mut random), organs: Vec::new() };
    let mut stems = Vec::new();
    for i in 0..organs.max(1) {
        let parent = (i > 0).then(|| stems[random.random_range(0..stems.len())]);
        let stem = i == 0 || random.random_bool(0.4);
        if stem {
            stems.push(i);
        }
        let mut within = |low: f64, high: f64| random.random_range(low..high);
        let joint = Joint {
            d: if i == 0 { 0.0 } else { within(0.0, 1.0) },
            scale: if i == 0 { within(0.1, 1.5) } else { within(0.1, 0.9) },
            rotation: DQuat::IDENTITY,
        };
        let mut sigmas = |count: usize| (0..count).map(|_| within(-2.5, 2.5)).collect::<Vec<f64>>();
        let (shape, bend, bow) =
            (sigmas(species.leaf.shape.rank()), sigmas(species.leaf.deform.rank()), sigmas(species.stem.deform.rank()));
        let width = if species.habit == Habit::Grass { within(0.5, 2.0) } else { 1.0 };
        let form = if stem {
            Form::Stem { gamma: bow, radius: within(0.003, 0.02) }
        } else {
            Form::Leaf { blade: Blade { beta: shape, gamma: bend, width }, leaf: (i / 3) as u16 }
        };
        let joint = Joint { rotation: turn(&mut random), ..joint };
        plant.organs.push(Organ { parent, joint, form });
    }
    plant
}

fn pose(random: &mut ChaCha8Rng) -> Pose {
    let mut metres = || random.random_range(-20.0..20.0);
    let translation = DVec3::new(metres(), metres(), metres());
    Pose::new(turn(random), translation)
}

/// A rotation with w >= 0.
fn turn(random: &mut ChaCha8Rng) -> DQuat {
    let mut part = || random.random_range(-1.0..1.0);
    let q = DQuat::from_xyzw(part(), part(), part(), part()).normalize();
    if q.w < 0.0 { -q } else { q }
}
