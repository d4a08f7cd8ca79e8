//! Depth known up to a scale and a shift of its inverse.

/// A pixel's guess and its truth, both inverse depths in units of their own.
pub(super) type Pair = (f64, f64);

/// Mean of |a guess + b - truth| / truth with the scale a and the shift b of least squares; `None` without pixels.
/// Truths are above 0.
pub(super) fn abs_rel(pairs: &[Pair]) -> Option<f64> {
    let n = pairs.len() as f64;
    let mean = |of: fn(&Pair) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (guess, truth) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let across: f64 = pairs.iter().map(|pair| (pair.0 - guess) * (pair.1 - truth)).sum();
    let spread: f64 = pairs.iter().map(|pair| (pair.0 - guess).powi(2)).sum();
    let scale = if spread > 0.0 { across / spread } else { 0.0 };
    let error = |pair: &Pair| (scale * (pair.0 - guess) + truth - pair.1).abs() / pair.1;
    (!pairs.is_empty()).then(|| pairs.iter().map(error).sum::<f64>() / n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_and_shift_cost_nothing_and_noise_does() {
        let pairs: Vec<Pair> = (1..50).map(|i| (f64::from(i), 3.0 * f64::from(i) + 7.0)).collect();
        assert!(abs_rel(&pairs).unwrap() < 1e-12);
        let other: Vec<Pair> = pairs.iter().map(|&(guess, truth)| (100.0 - 0.5 * guess, truth)).collect();
        assert!(abs_rel(&other).unwrap() < 1e-12);
        let bent: Vec<Pair> = pairs.iter().map(|&(guess, truth)| (guess.powi(2), truth)).collect();
        assert!(abs_rel(&bent).unwrap() > 0.05);
    }

    #[test]
    fn a_guess_that_is_the_same_everywhere_is_fitted_by_the_mean() {
        assert!((abs_rel(&[(1.0, 1.0), (1.0, 3.0)]).unwrap() - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(abs_rel(&[]), None);
    }
}
