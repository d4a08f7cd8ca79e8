//! Bends measured by how far they move an organ's points: the metric in which principal components are taken.
//!
//! An angle near the base moves more points than one near the tip, so variance of angles says little about variance
//! of surfaces. With x the coefficients of the smooth basis and J the derivative of the control points by them at the
//! mean organ, less what a rotation of the whole organ takes back, y = R x with RᵀR = JᵀJ / points has the
//! root-mean-square displacement as its length.

use std::ops::Range;

use glam::DVec3;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::deform::LearnError;
use super::pca::Pca;
use super::smooth::VEIN_MODES;
use crate::model::leaf::Blade;
use crate::model::{Basis, BasisError, Species};

/// Ridge on RᵀR as a share of its mean diagonal, so that a mode that moves nothing has an inverse.
const RIDGE: f64 = 1e-9;

/// Variance below which a mode is rounding, as a share of the largest.
const LEAST_VARIANCE: f64 = 1e-9;

/// The change of coordinates between a block of a smooth basis of angles and displacements.
#[derive(Clone, Debug)]
pub(super) struct Displacement {
    /// The smooth modes of the block.
    block: Range<usize>,
    smooth: Basis,
    /// R, upper triangular.
    factor: DMatrix<f64>,
}

impl Displacement {
    /// Of the species' blades, at its mean shape and the `mean` coefficients: of the vein's bends and of the ribs'. The
    /// two are learned apart, so that each component is found from what shows it: the course of a blade tells its vein,
    /// and a fit that starts from there has not bent the ribs by mere correlation. Organs are of unit length.
    pub(super) fn of_leaf(smooth: &Species, mean: Vec<f64>) -> Result<[Self; 2], LearnError> {
        let blade = Blade { beta: Vec::new(), gamma: mean, width: 1.0 };
        let jacobian = smooth.leaf.jacobian(&blade);
        let first = smooth.leaf.shape.rank();
        let of =
            |block| Self::of(&smooth.leaf.deform, block, &jacobian.points, |n, k| jacobian.derivative(n, first + k));
        Ok([of(0..VEIN_MODES)?, of(VEIN_MODES..smooth.leaf.deform.rank())?])
    }

    /// Of the species' stems.
    pub(super) fn of_stem(smooth: &Species, mean: &[f64]) -> Result<[Self; 1], LearnError> {
        let jacobian = smooth.stem.jacobian(mean);
        let stride = jacobian.coefficients;
        let block = 0..smooth.stem.deform.rank();
        Ok([Self::of(&smooth.stem.deform, block, &jacobian.points, |n, k| jacobian.derivatives[n * stride + k])?])
    }

    fn of(
        smooth: &Basis,
        block: Range<usize>,
        points: &[DVec3],
        velocity: impl Fn(usize, usize) -> DVec3,
    ) -> Result<Self, LearnError> {
        let rows = 3 * points.len();
        let scale = 1.0 / (points.len() as f64).sqrt();
        let flat = |of: &dyn Fn(usize) -> DVec3| {
            DVector::from_iterator(rows, (0..points.len()).flat_map(|n| (of(n) * scale).to_array()))
        };
        let turns = DMatrix::from_columns(&DVec3::AXES.map(|axis| flat(&|n| axis.cross(points[n]))));
        let moves =
            DMatrix::from_columns(&block.clone().map(|k| flat(&|n| velocity(n, k))).collect::<Vec<DVector<f64>>>());
        // What a rotation about the base takes back is no bend. A straight stem cannot roll, hence the pseudo-inverse.
        let inverse =
            (turns.transpose() * &turns).pseudo_inverse(1e-9).map_err(|_negative_epsilon| LearnError::Still)?;
        let moves = &moves - &turns * (inverse * (turns.transpose() * &moves));
        let mut gram = moves.transpose() * &moves;
        let ridge = RIDGE * gram.trace() / gram.nrows() as f64;
        (0..gram.nrows()).for_each(|k| gram[(k, k)] += ridge);
        let factor: Cholesky<f64, Dyn> = gram.cholesky().ok_or(LearnError::Still)?;
        let modes = smooth.components().rows(block.start, block.len()).into_owned();
        let sigma = smooth.sigma().rows(block.start, block.len()).into_owned();
        let smooth = Basis::new(DVector::zeros(smooth.dim()), modes, sigma)?;
        Ok(Self { block, smooth, factor: factor.l().transpose() })
    }

    /// Modes of the block.
    pub(super) fn rank(&self) -> usize {
        self.block.len()
    }

    /// Displacements of coefficients of the whole smooth basis.
    pub(super) fn of_coefficients(&self, coefficients: &[f64]) -> DVector<f64> {
        &self.factor * DVector::from_column_slice(&coefficients[self.block.clone()])
    }

    /// The smooth basis itself as a basis of displacements: its prior.
    pub(super) fn prior(&self) -> Result<Basis, BasisError> {
        Basis::from_modes(DVector::zeros(self.factor.nrows()), &self.factor.transpose())
    }

    /// A basis of angles as one of displacements, as far as the smooth modes span it.
    pub(super) fn of_basis(&self, angles: &Basis) -> Result<Basis, BasisError> {
        let displacement = |angles: &DVector<f64>| &self.factor * DVector::from_vec(self.smooth.project(angles));
        let mean = displacement(angles.mean());
        let rows: Vec<_> = (0..angles.rank())
            .map(|k| {
                let mut one = vec![0.0; k + 1];
                one[k] = 1.0;
                (displacement(&angles.at(&one)) - &mean).transpose()
            })
            .collect();
        Basis::from_modes(mean, &apart(&DMatrix::from_rows(&rows)))
    }

    /// A basis of displacements as one of angles: the same mean, the same covariance.
    pub(super) fn basis_of_angles(&self, of_displacements: &Pca) -> Result<Basis, BasisError> {
        let basis = &of_displacements.basis;
        let angles = |y: DVector<f64>| {
            let x = self.factor.solve_upper_triangular(&y).unwrap_or_else(|| DVector::zeros(y.len()));
            self.smooth.at(x.as_slice())
        };
        let mean = angles(basis.mean().clone());
        let rows: Vec<_> = (0..basis.rank())
            .map(|k| {
                (angles(basis.components().row(k).transpose() * basis.sigma()[k]) - self.smooth.mean()).transpose()
            })
            .collect();
        Basis::from_modes(mean, &apart(&DMatrix::from_rows(&rows)))
    }
}

/// Modes (rows) of the same covariance that are orthogonal, largest first: modes that are apart in one metric need not
/// be so in another.
fn apart(modes: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = (modes * modes.transpose()).symmetric_eigen();
    // What a block does not hold of a basis is rounding.
    let least = LEAST_VARIANCE * eigen.eigenvalues.max();
    let mut order: Vec<usize> = (0..modes.nrows()).filter(|k| eigen.eigenvalues[*k] > least).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let rows: Vec<_> = order.iter().map(|k| upright(eigen.eigenvectors.column(*k).transpose() * modes)).collect();
    DMatrix::from_rows(&rows)
}

/// A component with its sign fixed: its first angles that matter are positive.
fn upright(mode: nalgebra::RowDVector<f64>) -> nalgebra::RowDVector<f64> {
    let largest = mode.amax();
    let sign = mode.iter().find(|x| x.abs() >= 0.5 * largest).map_or(1.0, |x| x.signum());
    mode * sign
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::smooth::smooth;
    use crate::species::generic;

    #[test]
    fn displacements_are_those_of_the_points_and_bases_survive_the_change_of_metric() {
        let smooth = smooth(&generic("soybean").expect("listed").expect("valid")).expect("independent");
        let [vein, ribs] = Displacement::of_leaf(&smooth, Vec::new()).expect("blades move");
        let still = smooth.leaf.grid(&Blade { beta: Vec::new(), gamma: Vec::new(), width: 1.0 }).points;
        // A fold at the vein, small enough to be linear, with the best rotation about the base taken back.
        let mut gamma = vec![0.0; smooth.leaf.deform.rank()];
        gamma[VEIN_MODES] = 0.001;
        let bent = smooth.leaf.grid(&Blade { beta: Vec::new(), gamma: gamma.clone(), width: 1.0 }).points;
        let moves: Vec<DVec3> = bent.iter().zip(&still).map(|(p, q)| *p - *q).collect();
        let (mut inertia, mut turn) = (glam::DMat3::ZERO, DVec3::ZERO);
        for (p, moved) in still.iter().zip(&moves) {
            let outer = glam::DMat3::from_cols(*p * p.x, *p * p.y, *p * p.z);
            inertia += glam::DMat3::from_diagonal(DVec3::splat(p.length_squared())) - outer;
            turn += p.cross(*moved);
        }
        let turn = inertia.inverse() * turn;
        let left = still.iter().zip(&moves).map(|(p, moved)| (*moved - turn.cross(*p)).length_squared());
        let expected = (left.sum::<f64>() / still.len() as f64).sqrt();
        assert_eq!(vein.of_coefficients(&gamma).norm(), 0.0);
        let found = ribs.of_coefficients(&gamma).norm();
        assert!((found / expected - 1.0).abs() < 0.01, "{found} against {expected}");

        let rows = DMatrix::from_fn(6, gamma.len(), |i, k| ((i * 7 + k * 3) % 5) as f64 - 2.0);
        let moved: Vec<_> =
            rows.row_iter().map(|row| ribs.of_coefficients(row.transpose().as_slice()).transpose()).collect();
        let pca = Pca::new(&DMatrix::from_rows(&moved), 4).expect("varies");
        let again = ribs.of_basis(&ribs.basis_of_angles(&pca).expect("a basis")).expect("a basis");
        assert!((again.mean() - pca.basis.mean()).amax() < 1e-6 * pca.basis.mean().amax().max(1.0));
        let covariance = |b: &Basis| {
            let modes = DMatrix::from_diagonal(b.sigma()) * b.components();
            modes.tr_mul(&modes)
        };
        let (one, other) = (covariance(&again), covariance(&pca.basis));
        assert!((&one - &other).amax() < 1e-6 * other.amax(), "{}", (one - other).amax());
    }
}
