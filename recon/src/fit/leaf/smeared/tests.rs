use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::fit::leaf;
use crate::species::shipped;

const NOISE: f64 = 0.005;

fn species() -> Species {
    shipped("bean").expect("listed").expect("valid")
}

fn flat(metres: f64, species: &Species) -> State {
    State {
        base: DVec3::ZERO,
        rotation: glam::DQuat::IDENTITY,
        log_length: metres.ln(),
        log_width: 0.0,
        beta: vec![0.0; species.leaf.shape.rank()],
        gamma: vec![0.0; species.leaf.deform.rank()],
    }
}

fn area(state: &State, species: &Species) -> f64 {
    state.sheet(species, FINE).areas.iter().sum()
}

/// Points even by area on a blade, with noise.
fn noisy(state: &State, count: usize, species: &Species) -> Vec<DVec3> {
    let sheet = state.sheet(species, Lattice::WHOLE);
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let most = sheet.areas.iter().copied().fold(0.0, f64::max);
    // The sum of twelve even numbers is as good as normal.
    let normal = |random: &mut ChaCha8Rng| (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    let mut points = Vec::new();
    while points.len() < count {
        let n = random.random_range(0..sheet.points.len());
        if random.random::<f64>() * most < sheet.areas[n] {
            let off = DVec3::from_array([0; 3].map(|_| normal(&mut random)));
            points.push(sheet.points[n] + off * NOISE);
        }
    }
    points
}

#[test]
fn a_small_blade_is_found_behind_the_noise() {
    let species = species();
    for metres in [0.025, 0.04, 0.07] {
        let truth = flat(metres, &species);
        let points = noisy(&truth, 800, &species);
        let swollen = leaf::fit(&points, DVec3::ZERO, DVec3::Z, &species);
        let density = points.len() as f64 / area(&truth, &species);
        // How densely blades are sampled is known to a third only.
        let crowd = Crowd { log_density: density.ln() + 0.2, spread: 0.3, noise: NOISE };
        let cloud = Cloud { points: &points, count: points.len(), base: DVec3::ZERO, up: DVec3::Z };
        let found = again(&swollen, cloud, &species, crowd).expect("small");
        let share = |fit: &LeafFit| area(&fit.state, &species) / area(&truth, &species);
        assert!((share(&found) - 1.0).abs() < 0.12, "{metres} m: {} of the area", share(&found));
        assert!((share(&swollen) - 1.0).abs() > (share(&found) - 1.0).abs(), "{metres} m: {}", share(&swollen));
        if metres < 0.03 {
            assert!(share(&swollen) > 1.1, "nothing to mend: {}", share(&swollen));
        }
    }
    let large = flat(0.2, &species);
    let points = noisy(&large, 800, &species);
    let fit = leaf::fit(&points, DVec3::ZERO, DVec3::Z, &species);
    let crowd = Crowd { log_density: 10.0, spread: 0.3, noise: NOISE };
    let cloud = Cloud { points: &points, count: 800, base: DVec3::ZERO, up: DVec3::Z };
    assert!(again(&fit, cloud, &species, crowd).is_none());
}

#[test]
fn scores_are_the_gradients_of_finite_differences() {
    let species = species();
    let points = noisy(&flat(0.04, &species), 60, &species);
    let cloud = Cloud { points: &points, count: 60, base: DVec3::new(0.001, 0.002, -0.003), up: DVec3::Z };
    let crowd = Crowd { log_density: 11.0, spread: 0.3, noise: NOISE };
    let smeared = Smeared { points: &points, cloud, species: &species, lattice: COARSE, crowd };
    let state = State {
        rotation: glam::DQuat::from_scaled_axis(DVec3::new(0.2, -0.1, 0.3)),
        beta: vec![0.4; species.leaf.shape.rank()],
        gamma: vec![-0.3; species.leaf.deform.rank()],
        ..flat(0.05, &species)
    };
    let normal = smeared.normal(&state);
    let parameters = normal.g.len();
    let width = State::COEFFICIENTS + state.beta.len() + state.gamma.len();
    for k in (0..parameters).filter(|k| *k != width) {
        let by = |size: f64| {
            let step = DVector::from_fn(parameters, |i, _| if i == k { size } else { 0.0 });
            smeared.normal(&state.stepped(&step, &species)).cost
        };
        let finite = (by(1e-5) - by(-1e-5)) / 4e-5;
        assert!((normal.g[k] - finite).abs() < 1e-4 * (1.0 + finite.abs()), "{k}: {} and {finite}", normal.g[k]);
    }
}
