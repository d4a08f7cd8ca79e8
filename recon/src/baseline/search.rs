//! Bayesian optimisation over the unit cube: a Gaussian process and expected improvement.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Trials at random before the process steers.
const FIRST: usize = 24;
/// Trials in all; the best value has settled by then (measured on the clouds of the evaluation).
const TRIALS: usize = 120;
/// Places whose expected improvement is looked at before a trial: half anywhere, half beside the best.
const CANDIDATES: usize = 600;
/// Spread of the places beside the best.
const NEAR: f64 = 0.1;
/// Length over which values resemble each other, in cube sides; a usual choice for eight dimensions.
const LENGTH: f64 = 0.7;
/// Variance of a trial's noise beside that of the values; it also keeps the matrix regular.
const NOISE: f64 = 1e-4;

/// The place in [0, 1]^N where `cost` is least among those tried, and the cost there.
pub(super) fn minimise<const N: usize>(seed: u64, mut cost: impl FnMut(&[f64; N]) -> f64) -> ([f64; N], f64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut places: Vec<[f64; N]> = Vec::new();
    let mut costs: Vec<f64> = Vec::new();
    let mut best = ([0.5; N], f64::INFINITY);
    for trial in 0..TRIALS {
        let anywhere = |random: &mut ChaCha8Rng| std::array::from_fn(|_| random.random::<f64>());
        let process = if trial < FIRST { None } else { Process::of(&places, &costs) };
        let place = match process {
            None => anywhere(&mut random),
            Some(process) => {
                let mut chosen = (best.0, f64::NEG_INFINITY);
                for k in 0..CANDIDATES {
                    let mut place: [f64; N] = anywhere(&mut random);
                    if k % 2 == 1 {
                        place = std::array::from_fn(|i| (best.0[i] + NEAR * (2.0 * place[i] - 1.0)).clamp(0.0, 1.0));
                    }
                    let gain = process.expected_improvement(&place);
                    if gain > chosen.1 {
                        chosen = (place, gain);
                    }
                }
                chosen.0
            }
        };
        let found = cost(&place);
        if found < best.1 {
            best = (place, found);
        }
        // A trial without a value teaches only that it is no good.
        costs.push(if found.is_finite() { found } else { 1.0 });
        places.push(place);
    }
    best
}

/// A Gaussian process through what was tried, its values scaled to mean 0 and variance 1.
struct Process<'a, const N: usize> {
    places: &'a [[f64; N]],
    factor: Cholesky<f64, Dyn>,
    weights: DVector<f64>,
    least: f64,
}

impl<'a, const N: usize> Process<'a, N> {
    fn of(places: &'a [[f64; N]], costs: &[f64]) -> Option<Self> {
        let values = DVector::from_column_slice(costs);
        let deviation = values.variance().sqrt();
        let scaled = values.add_scalar(-values.mean()) / if deviation > 0.0 { deviation } else { 1.0 };
        let count = places.len();
        let same = |i, j| kernel(&places[i], &places[j]) + if i == j { NOISE } else { 0.0 };
        let factor = DMatrix::from_fn(count, count, same).cholesky()?;
        let weights = factor.solve(&scaled);
        Some(Self { places, factor, weights, least: scaled.min() })
    }

    /// How much lower than the best a trial at `place` is expected to be.
    fn expected_improvement(&self, place: &[f64; N]) -> f64 {
        let alike = DVector::from_iterator(self.places.len(), self.places.iter().map(|p| kernel(p, place)));
        let mean = alike.dot(&self.weights);
        let variance = 1.0 - alike.dot(&self.factor.solve(&alike));
        let deviation = variance.max(1e-12).sqrt();
        let z = (self.least - mean) / deviation;
        deviation * (z * normal_below(z) + (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt())
    }
}

fn kernel<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let squared: f64 = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum();
    (-squared / (2.0 * LENGTH * LENGTH)).exp()
}

/// Share of a normal distribution below z, by its logistic likeness (error below 0.01, which the choice of a
/// trial does not feel).
fn normal_below(z: f64) -> f64 {
    1.0 / (1.0 + (-1.702 * z).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_beats_as_many_throws_of_the_dice() {
        let bowl = |x: &[f64; 8]| x.iter().enumerate().map(|(i, x)| (x - 0.1 * i as f64).powi(2)).sum::<f64>();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let thrown = (0..TRIALS).map(|_| bowl(&std::array::from_fn(|_| random.random()))).fold(f64::INFINITY, f64::min);
        let (place, found) = minimise(5, bowl);
        assert!(found < thrown / 3.0, "{found} against {thrown}");
        assert_eq!(bowl(&place), found);
        assert_eq!(minimise(5, bowl), (place, found));
        assert_eq!(minimise::<2>(1, |_| f64::NAN).1, f64::INFINITY);
    }
}
