//! Measured values beside their truth: bias, RMSE, MAPE, R² and the coverage of intervals.

use crate::statistics::mean;

/// Half the width of a 95 % interval in standard uncertainties of a normal distribution.
const HALF_WIDTH_95: f64 = 1.959_964;

/// A measured value beside the truth, in one unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The true value.
    pub truth: f64,
    /// What was measured.
    pub measured: f64,
    /// Its standard uncertainty, where it was estimated.
    pub sigma: Option<f64>,
}

/// How well measured values agree with the truth.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Agreement {
    /// Pairs compared.
    pub count: usize,
    /// Mean of measured less true, in the values' unit.
    pub bias: f64,
    /// Root of the mean squared error, in the values' unit.
    pub rmse: f64,
    /// Mean of |error| / |truth| over truths that are not zero; a share, not per cent.
    pub mape: Option<f64>,
    /// 1 - squared error over the truth's own squared spread; `None` when the truth does not vary.
    pub r2: Option<f64>,
    /// Share of 95 % intervals that hold the truth, of the pairs that have a sigma.
    pub coverage: Option<f64>,
}

impl Agreement {
    /// Compares; `None` without pairs. Pairs that are not finite are left out.
    #[must_use]
    pub fn of(pairs: &[Pair]) -> Option<Self> {
        let pairs: Vec<&Pair> = pairs.iter().filter(|p| p.truth.is_finite() && p.measured.is_finite()).collect();
        let errors = || pairs.iter().map(|p| p.measured - p.truth);
        let mean_truth = mean(pairs.iter().map(|p| p.truth))?;
        let squared: f64 = errors().map(|e| e * e).sum();
        let spread: f64 = pairs.iter().map(|p| (p.truth - mean_truth).powi(2)).sum();
        let relative = pairs.iter().filter(|p| p.truth != 0.0).map(|p| ((p.measured - p.truth) / p.truth).abs());
        let held = |p: &&Pair| Some(f64::from((p.measured - p.truth).abs() <= HALF_WIDTH_95 * p.sigma?));
        Some(Self {
            count: pairs.len(),
            bias: mean(errors())?,
            rmse: (squared / pairs.len() as f64).sqrt(),
            mape: mean(relative),
            r2: (spread > 0.0).then(|| 1.0 - squared / spread),
            coverage: mean(pairs.iter().filter_map(held)),
        })
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    use super::*;

    fn pair(truth: f64, measured: f64, sigma: Option<f64>) -> Pair {
        Pair { truth, measured, sigma }
    }

    #[test]
    fn a_worked_example() {
        let pairs = [pair(1.0, 1.1, Some(0.1)), pair(2.0, 1.8, Some(0.1)), pair(4.0, 4.4, None), pair(0.0, 0.1, None)];
        let found = Agreement::of(&pairs).unwrap();
        assert_eq!(found.count, 4);
        assert_relative_eq!(found.bias, 0.1, epsilon = 1e-12);
        assert_relative_eq!(found.rmse, (0.22_f64 / 4.0).sqrt(), epsilon = 1e-12);
        // The true zero has no relative error.
        assert_relative_eq!(found.mape.unwrap(), 0.1, epsilon = 1e-12);
        assert_relative_eq!(found.r2.unwrap(), 1.0 - 0.22 / 8.75, epsilon = 1e-12);
        // 0.1 is within 1.96 x 0.1, 0.2 is not.
        assert_eq!(found.coverage, Some(0.5));
        assert_eq!(Agreement::of(&[]), None);
        assert_eq!(Agreement::of(&[pair(f64::NAN, 1.0, None)]), None);
        assert_eq!(Agreement::of(&[pair(1.0, 1.0, None); 3]).unwrap().r2, None);
    }

    proptest! {
        #[test]
        fn errors_scale_with_the_unit_and_ratios_do_not(
            values in prop::collection::vec((0.1..10.0_f64, 0.1..10.0_f64), 2..40), unit in 0.01..100.0_f64,
        ) {
            let pairs = |unit: f64| -> Vec<Pair> {
                values.iter().map(|(t, m)| pair(t * unit, m * unit, Some(unit))).collect()
            };
            let (one, other) = (Agreement::of(&pairs(1.0)).unwrap(), Agreement::of(&pairs(unit)).unwrap());
            prop_assert!((one.rmse * unit - other.rmse).abs() <= 1e-9 * other.rmse.max(1e-9));
            prop_assert!((one.bias * unit - other.bias).abs() <= 1e-9 * unit * 10.0);
            prop_assert!((one.mape.unwrap() - other.mape.unwrap()).abs() < 1e-9);
            prop_assert!(one.rmse >= one.bias.abs() - 1e-12);
        }
    }
}
