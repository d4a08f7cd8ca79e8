use nalgebra::{DMatrix, DVector, DVectorView};

/// Why a linear basis is refused.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum BasisError {
    /// Matrix, mean and σ do not belong together.
    #[error("basis {part}: expected length {expected}, found {found}")]
    Shape {
        /// Which part.
        part: &'static str,
        /// Length it must have.
        expected: usize,
        /// Length it has.
        found: usize,
    },
    /// A number that is not finite, or a σ that is not positive.
    #[error("basis {part}: expected {expected}")]
    Value {
        /// Which part.
        part: &'static str,
        /// What it must hold.
        expected: &'static str,
    },
    /// Components that are not orthonormal.
    #[error("basis components: expected orthonormal rows within 1e-6, found an error of {found}")]
    NotOrthonormal {
        /// Largest deviation of the Gram matrix from the identity.
        found: f64,
    },
}

/// A linear basis `x = mean + Φᵀ diag(σ) c` (paper eq. 4 and 5): coefficients are in standard deviations.
///
/// `components` is Φ `[K, N]`, column-major, so the K entries that touch one output lie side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Basis {
    mean: DVector<f64>,
    components: DMatrix<f64>,
    sigma: DVector<f64>,
    /// `diag(σ) Φ`, the derivative of the output by the coefficients.
    scaled: DMatrix<f64>,
}

impl Basis {
    /// Checks and keeps a basis.
    ///
    /// # Errors
    /// [`BasisError`] when sizes disagree, a number is not finite, σ is not positive or Φ is not orthonormal.
    pub fn new(mean: DVector<f64>, components: DMatrix<f64>, sigma: DVector<f64>) -> Result<Self, BasisError> {
        let shape = |part, expected, found| Err(BasisError::Shape { part, expected, found });
        if components.ncols() != mean.len() {
            return shape("components", mean.len(), components.ncols());
        }
        if sigma.len() != components.nrows() {
            return shape("sigma", components.nrows(), sigma.len());
        }
        if !mean.iter().chain(components.iter()).all(|x| x.is_finite()) {
            return Err(BasisError::Value { part: "mean and components", expected: "finite numbers" });
        }
        if !sigma.iter().all(|s| s.is_finite() && *s > 0.0) {
            return Err(BasisError::Value { part: "sigma", expected: "finite numbers above 0" });
        }
        let gram = &components * components.transpose();
        let found = (gram - DMatrix::identity(sigma.len(), sigma.len())).amax();
        if found > 1e-6 {
            return Err(BasisError::NotOrthonormal { found });
        }
        let scaled = DMatrix::from_diagonal(&sigma) * &components;
        Ok(Self { mean, components, sigma, scaled })
    }

    /// Orthonormalises hand-made modes (rows of `[K, N]`, one standard deviation each) by Gram-Schmidt in order;
    /// σ is the length of what is new in each mode.
    ///
    /// # Errors
    /// [`BasisError`] when modes are not finite or depend on each other.
    pub fn from_modes(mean: DVector<f64>, modes: &DMatrix<f64>) -> Result<Self, BasisError> {
        let mut components = modes.clone();
        let mut sigma = DVector::zeros(modes.nrows());
        for k in 0..modes.nrows() {
            let mut row = components.row(k).into_owned();
            // Twice, because one pass loses orthogonality when modes are nearly parallel.
            for _ in 0..2 {
                for earlier in 0..k {
                    let other = components.row(earlier).into_owned();
                    row -= &other * row.dot(&other);
                }
            }
            sigma[k] = row.norm();
            components.set_row(k, &(row / sigma[k].max(f64::MIN_POSITIVE)));
        }
        Self::new(mean, components, sigma)
    }

    /// Number of components K.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.sigma.len()
    }

    /// Number of outputs N.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// The output at `coefficients` (in σ); missing trailing coefficients count as 0, surplus ones are ignored.
    #[must_use]
    pub fn at(&self, coefficients: &[f64]) -> DVector<f64> {
        let k = self.rank().min(coefficients.len());
        let c = DVector::from_column_slice(&coefficients[..k]);
        &self.mean + self.scaled.rows(0, k).tr_mul(&c)
    }

    /// Output `n` at `coefficients` (in σ), counted as by [`Basis::at`].
    #[must_use]
    pub fn one(&self, n: usize, coefficients: &[f64]) -> f64 {
        let k = self.rank().min(coefficients.len());
        let (along, c) = (&self.derivative(n)[..k], &coefficients[..k]);
        // Four sums at once: a single one would wait for each addition.
        let ((along, along_rest), (c, c_rest)) = (along.as_chunks::<4>(), c.as_chunks::<4>());
        let mut sums = [0.0; 4];
        for (along, c) in along.iter().zip(c) {
            for lane in 0..4 {
                sums[lane] += along[lane] * c[lane];
            }
        }
        let rest: f64 = along_rest.iter().zip(c_rest).map(|(along, c)| along * c).sum();
        self.mean[n] + (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
    }

    /// The least-squares coefficients (in σ) of an output: the projection on Φ.
    #[must_use]
    pub fn project(&self, output: &DVector<f64>) -> Vec<f64> {
        let along = &self.components * (output - &self.mean);
        along.component_div(&self.sigma).iter().copied().collect()
    }

    /// The most likely coefficients (in σ) of an output of which only some numbers are `known` (index and value), each to
    /// a standard deviation of `sd`: those that are not say nothing, where [`Basis::project`] would have them said.
    #[must_use]
    pub fn likely(&self, known: &[(usize, f64)], sd: f64) -> Vec<f64> {
        let mut h = DMatrix::identity(self.rank(), self.rank());
        let mut g = DVector::zeros(self.rank());
        for (n, value) in known {
            let row = DVectorView::from_slice(self.derivative(*n), self.rank());
            h.ger(sd.powi(-2), &row, &row, 1.0);
            g.axpy((value - self.mean[*n]) / sd.powi(2), &row, 1.0);
        }
        // The identity makes it positive definite whatever is known.
        h.cholesky().map_or_else(|| vec![0.0; self.rank()], |h| h.solve(&g).iter().copied().collect())
    }

    /// Derivatives of output `n` by every coefficient.
    #[must_use]
    pub fn derivative(&self, n: usize) -> &[f64] {
        let k = self.rank();
        &self.scaled.as_slice()[n * k..(n + 1) * k]
    }

    /// Output at zero coefficients.
    #[must_use]
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// Φ `[K, N]`.
    #[must_use]
    pub fn components(&self) -> &DMatrix<f64> {
        &self.components
    }

    /// σ of each component, in units of the output.
    #[must_use]
    pub fn sigma(&self) -> &DVector<f64> {
        &self.sigma
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_decides_and_what_is_not_stays_likely() {
        let modes = DMatrix::from_row_slice(2, 3, &[2.0, 1.0, 0.0, 0.0, 0.0, 3.0]);
        let basis = Basis::from_modes(DVector::from_vec(vec![1.0, 0.0, 0.0]), &modes).expect("independent");
        let found = basis.likely(&[(1, 1.5)], 1e-4);
        // The first mode alone moves output 1, by 1 at one σ; the second is unknown, so 0.
        assert!((found[0] - 1.5).abs() < 1e-6 && found[1].abs() < 1e-12, "{found:?}");
        assert_eq!(basis.likely(&[], 1.0), [0.0, 0.0]);
    }

    #[test]
    fn projection_inverts_evaluation_and_dependent_modes_are_refused() {
        let modes = DMatrix::from_row_slice(2, 3, &[2.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
        let basis = Basis::from_modes(DVector::from_vec(vec![1.0, 2.0, 3.0]), &modes).expect("independent");
        let c = basis.project(&basis.at(&[0.5, -2.0]));
        assert!((c[0] - 0.5).abs() < 1e-12 && (c[1] + 2.0).abs() < 1e-12, "{c:?}");
        let dependent = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
        assert!(Basis::from_modes(DVector::zeros(3), &dependent).is_err());
    }
}
