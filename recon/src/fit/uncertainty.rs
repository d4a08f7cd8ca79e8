//! How sure traits are: the covariance of the fit, what the model is off by, and what of a blade nobody saw.

use crate::traits::{Sigma, Sigmas, keys};

/// Standard deviations that the data do not tell, because the model itself is off: shares of the value for areas,
/// lengths and curvature, radians for angles. Of blades from grown plants of other shapes than the fit's mean (seeds 1
/// to 10 of the synthetic world), guesses for what plants of the field add; of stems guesses: they taper and swell.
const BIAS: [(&str, f64); 13] = [
    (keys::LEAF_AREA, 0.03),
    (keys::LEAF_LENGTH, 0.015),
    (keys::LEAF_WIDTH, 0.04),
    (keys::LEAF_CURVATURE, 0.2),
    (keys::LEAF_INCLINATION, 0.008),
    (keys::LEAF_AZIMUTH, 0.01),
    (keys::LEAF_INSERTION_ANGLE, 0.08),
    (keys::STEM_LENGTH, 0.01),
    (keys::STEM_DIAMETER, 0.1),
    (keys::PETIOLE_LENGTH, 0.03),
    (keys::INTERNODE_LENGTH, 0.05),
    (keys::PETIOLE_ANGLE, 0.03),
    (keys::STEM_LEAN, 0.005),
];
/// Standard deviation of a trait by the share of its area that a blade may hide: shares of the value, of the inclination
/// radians. From grown plants with noise and points taken away (tools/helios, seeds 2000 to 2003).
const HIDDEN: [(&str, f64); 4] =
    [(keys::LEAF_AREA, 2.0), (keys::LEAF_LENGTH, 0.6), (keys::LEAF_WIDTH, 0.6), (keys::LEAF_INCLINATION, 0.15)];
/// Factor on the covariance for what its linear form leaves out: starts in a wrong valley, wrong neighbours.
const INFLATION: f64 = 3.0;

/// The uncertainties of traits from their variances by the normal equations; those that are not finite are left out.
pub(super) fn sigmas(variances: impl IntoIterator<Item = (&'static str, f64)>) -> Sigmas {
    let model = |key| BIAS.iter().find(|(of, _)| *of == key).map_or(0.0, |(_, bias)| *bias);
    let data = variances.into_iter().map(|(key, variance)| (key, (INFLATION * variance).sqrt()));
    data.filter(|(_, data)| data.is_finite()).map(|(key, data)| (key, Sigma { data, model: model(key) })).collect()
}

/// Widens a blade's uncertainties for what it may hide, as a share of its area.
pub(super) fn doubt(sigmas: &mut Sigmas, hidden: f64) {
    for (key, share) in HIDDEN {
        if let Some(sigma) = sigmas.get_mut(key) {
            sigma.model = sigma.model.hypot(share * hidden);
        }
    }
}
