//! How sure a blade's traits are: the Gauss-Newton covariance carried to each trait by its gradient.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use super::equations::Rows;
use super::fields;
use crate::fit::uncertainty;
use crate::statistics::mean;
use crate::traits::Sigmas;

/// The uncertainty of each trait at the end of a fit whose normal equations are `h` (σ of the data = 1).
pub(super) fn sigmas(h: DMatrix<f64>, rows: &Rows<'_>, up: DVec3) -> Sigmas {
    let Some(cholesky) = h.cholesky() else { return Sigmas::new() };
    let variance = |field: &fields::Field| {
        let mut gradient = DVector::zeros(rows.parameters);
        for (n, way) in field {
            rows.add_gradient(*n, *way, gradient.as_mut_slice());
        }
        gradient.dot(&cholesky.solve(&gradient))
    };
    uncertainty::sigmas(
        fields::of(rows.sheet, up)
            .into_iter()
            .filter_map(|(key, fields)| Some((key, mean(fields.iter().map(variance))?))),
    )
}
