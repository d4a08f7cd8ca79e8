//! How sure a blade's traits are: the Gauss-Newton covariance carried to each trait by its gradient, with what the
//! model cannot say added.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use super::equations::Rows;
use super::fields;
use crate::traits::{Sigma, Sigmas, keys};

/// Standard deviations that the data do not tell, because the model itself is off: shares of the value for area,
/// lengths and curvature, radians for angles. From grown plants of other shapes than the fit's mean (seeds 1 to 10 of
/// the synthetic world); guesses for what plants of the field add.
const BIAS: [(&str, f64); 7] = [
    (keys::LEAF_AREA, 0.03),
    (keys::LEAF_LENGTH, 0.015),
    (keys::LEAF_WIDTH, 0.04),
    (keys::LEAF_CURVATURE, 0.2),
    (keys::LEAF_INCLINATION, 0.008),
    (keys::LEAF_AZIMUTH, 0.01),
    (keys::LEAF_INSERTION_ANGLE, 0.08),
];
/// Factor on the covariance for what its linear form leaves out: starts in a wrong valley, wrong neighbours.
const INFLATION: f64 = 3.0;

/// The uncertainty of each trait at the end of a fit whose normal equations are `h` (σ of the data = 1).
pub(super) fn sigmas(h: DMatrix<f64>, rows: &Rows<'_>, up: DVec3) -> Sigmas {
    let Some(cholesky) = h.cholesky() else { return Sigmas::new() };
    let bias = |key| BIAS.iter().find(|(of, _)| *of == key).map_or(0.0, |(_, bias)| *bias);
    let mut sigmas = Sigmas::new();
    for (key, fields) in fields::of(rows.sheet, up) {
        let variance = |field: &fields::Field| {
            let mut gradient = DVector::zeros(rows.parameters);
            for (n, way) in field {
                rows.add_gradient(*n, *way, gradient.as_mut_slice());
            }
            gradient.dot(&cholesky.solve(&gradient))
        };
        let variance = fields.iter().map(variance).sum::<f64>() / fields.len() as f64;
        let data = (INFLATION * variance).sqrt();
        if data.is_finite() {
            sigmas.insert(key, Sigma { data, model: bias(key) });
        }
    }
    sigmas
}
