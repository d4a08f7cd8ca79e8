//! Principal components of organs: alone, or started from a related species' basis.

use nalgebra::{DMatrix, DVector, RowDVector, SymmetricEigen};

use crate::model::{Basis, BasisError};

/// Components whose variance is below this share of the largest are rounding, not data.
const NOISE_SHARE: f64 = 1e-12;
/// The first entry of a component within this share of its largest one is made positive. Not the largest itself:
/// mirrored organs have two that differ by rounding, and new data would flip the component.
const SIGN_SHARE: f64 = 0.9;
/// Sweeps of the eigenvalue solver per row; it needs two or three.
const SWEEPS: usize = 100;

/// Why nothing can be learned.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PcaError {
    /// Not enough samples for a variance.
    #[error("samples: expected at least {expected}, found {found}")]
    Samples {
        /// Least number.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// Samples of another length than the prior's outputs.
    #[error("sample length: expected {expected} as the prior has, found {found}")]
    Length {
        /// Outputs of the prior.
        expected: usize,
        /// Length of the samples.
        found: usize,
    },
    /// Numbers that are not finite.
    #[error("samples: expected finite numbers, found one that is not in sample {sample}")]
    NotFinite {
        /// First such sample.
        sample: usize,
    },
    /// Samples that are all the same, or no component asked for.
    #[error("expected at least one component with variance, found none")]
    NoVariance,
    /// The eigenvalues did not settle.
    #[error("eigenvalues: expected to settle within {expected} sweeps")]
    Unsettled {
        /// Sweeps allowed.
        expected: usize,
    },
    /// The basis was refused.
    #[error(transparent)]
    Basis(#[from] BasisError),
}

/// A learned basis and how much each component tells.
#[derive(Clone, Debug, PartialEq)]
pub struct Pca {
    /// Components in falling order of σ, each with its sign fixed.
    pub basis: Basis,
    /// Share of the total variance `[K]` that each component explains.
    pub explained: Vec<f64>,
}

/// What is believed before samples are seen: a related species, worth so many samples (normal-inverse-Wishart).
#[derive(Clone, Copy, Debug)]
pub struct Prior<'a> {
    /// The related species' basis.
    pub basis: &'a Basis,
    /// Samples that its mean is worth.
    pub mean_samples: f64,
    /// Samples that its σ and components are worth.
    pub spread_samples: f64,
}

impl Pca {
    /// Principal components of `samples` `[M, N]`, at most `components` of them and at most M - 1.
    ///
    /// An output that is the same in all samples stays exactly so for every coefficient: base and tip of flat leaves.
    ///
    /// # Errors
    /// [`PcaError`] with fewer than two samples, numbers that are not finite, or samples all the same.
    pub fn new(samples: &DMatrix<f64>, components: usize) -> Result<Self, PcaError> {
        if samples.nrows() < 2 {
            return Err(PcaError::Samples { expected: 2, found: samples.nrows() });
        }
        let (mean, centred) = centre(samples)?;
        principal(mean, &(centred / (samples.nrows() as f64 - 1.0).sqrt()), components)
    }

    /// Mean and components after `samples` `[M, N]`, M >= 1, where `prior` was believed before them: the posterior mode
    /// of a normal distribution with a normal-inverse-Wishart prior. Many samples forget the prior.
    ///
    /// # Errors
    /// [`PcaError`] without samples, with samples of another length than the prior's, or as [`Pca::new`].
    pub fn adapted(prior: Prior<'_>, samples: &DMatrix<f64>, components: usize) -> Result<Self, PcaError> {
        let (m, n) = samples.shape();
        if m < 1 {
            return Err(PcaError::Samples { expected: 1, found: 0 });
        }
        if n != prior.basis.dim() {
            return Err(PcaError::Length { expected: prior.basis.dim(), found: n });
        }
        let (own, centred) = centre(samples)?;
        let weight = prior.mean_samples + m as f64;
        let shift = &own - prior.basis.mean();
        let mean = &own - &shift * (prior.mean_samples / weight);
        // One factor R whose RᵀR is the posterior scatter: own deviations, the prior's modes, the shift of the mean.
        let modes = DMatrix::from_diagonal(prior.basis.sigma()) * prior.basis.components();
        let mut factor = DMatrix::zeros(m + modes.nrows() + 1, n);
        factor.rows_mut(0, m).copy_from(&centred);
        factor.rows_mut(m, modes.nrows()).copy_from(&(modes * prior.spread_samples.sqrt()));
        let shifted = shift.transpose() * (prior.mean_samples * m as f64 / weight).sqrt();
        factor.set_row(m + prior.basis.rank(), &shifted);
        principal(mean, &(factor / (prior.spread_samples + m as f64).sqrt()), components)
    }
}

/// The samples of every fold, by index: fold f holds f, f + `folds`, f + 2 `folds`... Pairs (the others, the fold's).
pub fn folds(samples: usize, folds: usize) -> impl Iterator<Item = (Vec<usize>, Vec<usize>)> {
    (0..folds.min(samples)).map(move |fold| (0..samples).partition(|i| i % folds != fold))
}

/// The mean of the rows, and the rows less it. Outputs without variance become exactly 0, so that no rounding of the
/// mean makes constant outputs move.
fn centre(samples: &DMatrix<f64>) -> Result<(DVector<f64>, DMatrix<f64>), PcaError> {
    if let Some(sample) = (0..samples.nrows()).find(|i| !samples.row(*i).iter().all(|x| x.is_finite())) {
        return Err(PcaError::NotFinite { sample });
    }
    let mean = DVector::from_iterator(
        samples.ncols(),
        samples.column_iter().map(|column| {
            let first = column[0];
            first + column.iter().map(|x| x - first).sum::<f64>() / column.len() as f64
        }),
    );
    let centred = DMatrix::from_fn(samples.nrows(), samples.ncols(), |i, j| samples[(i, j)] - mean[j]);
    Ok((mean, centred))
}

/// The largest eigenpairs of the covariance RᵀR of a `factor` R `[M, N]`, through whichever of RRᵀ and RᵀR is smaller.
pub(super) fn principal(mean: DVector<f64>, factor: &DMatrix<f64>, components: usize) -> Result<Pca, PcaError> {
    let (m, n) = factor.shape();
    if m.min(n) == 0 {
        return Err(PcaError::NoVariance);
    }
    let gram = if m <= n { factor * factor.transpose() } else { factor.tr_mul(factor) };
    let total = gram.trace();
    let eigen = SymmetricEigen::try_new(gram, f64::EPSILON, SWEEPS * m.min(n))
        .ok_or(PcaError::Unsettled { expected: SWEEPS * m.min(n) })?;
    let mut order: Vec<usize> = (0..m.min(n)).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let largest = order.first().map_or(0.0, |first| eigen.eigenvalues[*first]);
    order.retain(|k| eigen.eigenvalues[*k] > largest * NOISE_SHARE);
    order.truncate(components);
    if order.is_empty() {
        return Err(PcaError::NoVariance);
    }
    let modes: Vec<RowDVector<f64>> = order
        .iter()
        .map(|k| {
            let vector = eigen.eigenvectors.column(*k);
            // Through the factor either way, so that an output without variance is exactly 0 in every mode.
            let mode = factor.tr_mul(&if m <= n { vector.into_owned() } else { factor * vector });
            let mode = &mode * (eigen.eigenvalues[*k].sqrt() / mode.norm());
            let largest = mode.amax();
            let sign = mode.iter().find(|x| x.abs() >= SIGN_SHARE * largest).map_or(1.0, |x| x.signum());
            (mode * sign).transpose()
        })
        .collect();
    // Gram-Schmidt once more: the short way through RRᵀ loses orthogonality among the small components.
    let basis = Basis::from_modes(mean, &DMatrix::from_rows(&modes))?;
    let explained = basis.sigma().iter().map(|sigma| sigma * sigma / total).collect();
    Ok(Pca { basis, explained })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn samples(rows: usize, columns: usize) -> impl Strategy<Value = DMatrix<f64>> {
        proptest::collection::vec(-1.0..1.0f64, rows * columns)
            .prop_map(move |numbers| DMatrix::from_row_slice(rows, columns, &numbers))
    }

    fn row(samples: &DMatrix<f64>, i: usize) -> DVector<f64> {
        samples.row(i).transpose()
    }

    proptest! {
        #[test]
        fn all_components_rebuild_every_sample_and_explain_everything(wide in samples(5, 9), tall in samples(9, 5)) {
            for samples in [wide, tall] {
                let pca = Pca::new(&samples, 99).unwrap();
                prop_assert!((pca.explained.iter().sum::<f64>() - 1.0).abs() < 1e-9);
                prop_assert!(pca.explained.is_sorted_by(|a, b| a >= b));
                for i in 0..samples.nrows() {
                    let again = pca.basis.at(&pca.basis.project(&row(&samples, i)));
                    prop_assert!((again - row(&samples, i)).amax() < 1e-9);
                }
            }
        }

        #[test]
        fn coefficients_of_the_samples_have_unit_variance_and_mean_zero(samples in samples(8, 6)) {
            let pca = Pca::new(&samples, 3).unwrap();
            let betas: Vec<Vec<f64>> = (0..8).map(|i| pca.basis.project(&row(&samples, i))).collect();
            for k in 0..3 {
                let mean = betas.iter().map(|b| b[k]).sum::<f64>() / 8.0;
                let variance = betas.iter().map(|b| (b[k] - mean).powi(2)).sum::<f64>() / 7.0;
                prop_assert!(mean.abs() < 1e-9 && (variance - 1.0).abs() < 1e-6, "{mean} {variance}");
            }
        }

        #[test]
        fn the_order_of_the_samples_does_not_matter(samples in samples(6, 9)) {
            let turned = DMatrix::from_fn(6, 9, |i, j| samples[(5 - i, j)]);
            let (one, two) = (Pca::new(&samples, 2).unwrap(), Pca::new(&turned, 2).unwrap());
            // Only where the components are well apart are they determined.
            prop_assume!(one.explained[0] - one.explained[1] > 0.05);
            let (one, two) = (one.basis.components().row(0), two.basis.components().row(0));
            prop_assert!((one - two).amax() < 1e-6 || (one + two).amax() < 1e-6);
        }

        #[test]
        fn constant_outputs_never_move(samples in samples(7, 6), constant in -3.0..3.0f64, beta in -3.0..3.0f64) {
            let mut samples = samples;
            samples.column_mut(2).fill(constant);
            let pca = Pca::new(&samples, 4).unwrap();
            prop_assert_eq!(pca.basis.at(&[beta; 4])[2], constant);
        }

        #[test]
        fn adapting_moves_from_the_prior_to_the_samples(own in samples(6, 5), other in samples(6, 5)) {
            let (alone, prior) = (Pca::new(&own, 5).unwrap(), Pca::new(&other, 5).unwrap().basis);
            let adapted = |weight| {
                let prior = Prior { basis: &prior, mean_samples: weight, spread_samples: weight };
                Pca::adapted(prior, &own, 5).unwrap().basis
            };
            prop_assert!((adapted(0.0).mean() - alone.basis.mean()).amax() < 1e-12);
            // Without a prior the spread is the samples' own, divided by M and not by M - 1.
            let ratio = adapted(0.0).sigma()[0] / alone.basis.sigma()[0];
            prop_assert!((ratio - (5.0f64 / 6.0).sqrt()).abs() < 1e-9);
            let stubborn = adapted(1e9);
            prop_assert!((stubborn.mean() - prior.mean()).amax() < 1e-6);
            prop_assert!((stubborn.sigma()[0] - prior.sigma()[0]).abs() < 1e-6);
        }
    }

    #[test]
    fn every_sample_is_left_out_once() {
        let mut seen: Vec<usize> = folds(7, 3).flat_map(|(_, held)| held).collect();
        seen.sort_unstable();
        assert_eq!(seen, [0, 1, 2, 3, 4, 5, 6]);
        assert!(folds(7, 3).all(|(rest, held)| rest.len() + held.len() == 7 && rest.iter().all(|i| !held.contains(i))));
        assert_eq!(folds(2, 5).count(), 2);
    }

    #[test]
    fn what_has_no_components_is_refused() {
        let none = |samples: DMatrix<f64>| Pca::new(&samples, 3).map(|_| ());
        assert_eq!(none(DMatrix::zeros(1, 4)), Err(PcaError::Samples { expected: 2, found: 1 }));
        assert_eq!(none(DMatrix::from_element(3, 4, 0.1)), Err(PcaError::NoVariance));
        assert_eq!(none(DMatrix::zeros(3, 0)), Err(PcaError::NoVariance));
        let mut broken = DMatrix::from_fn(3, 4, |i, j| (i * j) as f64);
        broken[(1, 2)] = f64::NAN;
        assert_eq!(none(broken), Err(PcaError::NotFinite { sample: 1 }));
    }
}
