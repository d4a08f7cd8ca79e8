//! Figures that stand for many numbers.

use std::borrow::Borrow;

/// Standard deviations in one median absolute deviation of a normal distribution: 1/Φ⁻¹(3/4).
const SIGMA_OF_MAD: f64 = 1.4826;

/// The `share` quantile (0..=1) of values in any order, linear between neighbours; `None` without values.
#[must_use]
pub fn quantile(values: impl IntoIterator<Item: Borrow<f64>>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().map(|value| *value.borrow()).collect();
    let at = share.clamp(0.0, 1.0) * values.len().checked_sub(1)? as f64;
    let (_, low, above) = values.select_nth_unstable_by(at as usize, f64::total_cmp);
    match above.iter().copied().min_by(f64::total_cmp) {
        Some(high) if at.fract() > 0.0 => Some(*low + (high - *low) * at.fract()),
        _ => Some(*low),
    }
}

/// `None` without values.
#[must_use]
pub fn median(values: impl IntoIterator<Item: Borrow<f64>>) -> Option<f64> {
    quantile(values, 0.5)
}

/// `None` without values.
#[must_use]
pub fn mean(values: impl IntoIterator<Item: Borrow<f64>>) -> Option<f64> {
    let add = |(sum, count): (f64, usize), value: f64| (sum + value, count + 1);
    let (sum, count) = values.into_iter().map(|value| *value.borrow()).fold((0.0, 0), add);
    (count > 0).then(|| sum / count as f64)
}

/// The standard deviation of misses about 0 that strays do not move, if the others are normal; 0 without misses.
#[must_use]
pub fn deviation(misses: impl IntoIterator<Item = f64>) -> f64 {
    SIGMA_OF_MAD * median(misses.into_iter().map(f64::abs)).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn quantiles_grow_with_their_share(
            values in prop::collection::vec(-9.0..9.0_f64, 1..40),
            a in 0.0..=1.0_f64,
            b in 0.0..=1.0_f64,
        ) {
            let (low, high) = (quantile(&values, a.min(b)).unwrap(), quantile(&values, a.max(b)).unwrap());
            prop_assert!(low <= high);
            prop_assert_eq!(quantile(&values, 0.0).unwrap(), values.iter().copied().fold(f64::INFINITY, f64::min));
            prop_assert_eq!(quantile(&values, 1.0).unwrap(), values.iter().copied().fold(f64::NEG_INFINITY, f64::max));
        }

        #[test]
        fn half_of_the_strays_do_not_move_a_deviation(stray in 1e3..1e9_f64) {
            let mut misses: Vec<f64> = (-50..=50).map(|k| f64::from(k) / 50.0).collect();
            let clean = deviation(misses.clone());
            misses.extend([stray; 10]);
            prop_assert!(deviation(misses) < 1.3 * clean);
        }
    }

    #[test]
    fn worked_examples() {
        assert_eq!(quantile([4.0, 1.0, 3.0, 2.0], 0.5), Some(2.5));
        assert_eq!(median([f64::INFINITY, 1.0, 2.0]), Some(2.0));
        assert_eq!(mean([1.0, 2.0, 6.0]), Some(3.0));
        assert_eq!((median([0.0; 0]), mean([0.0; 0]), deviation([])), (None, None, 0.0));
    }

    #[test]
    fn deviations_of_a_normal_sample_are_its_standard_deviation() {
        // Quantiles of the logistic curve come near a normal distribution's; its own median deviation is ln 3.
        let misses = (1..1000).map(|k| f64::from(k) / 1000.0).map(|p| (p / (1.0 - p)).ln());
        assert_relative_eq!(deviation(misses), 1.4826 * 3.0_f64.ln(), epsilon = 1e-2);
    }
}
