//! How sure stems' traits are: the covariance of stage 2, every organ's with that of all below it, and what the model
//! cannot say added.

use glam::DVec3;
use nalgebra::DMatrix;

use super::elimination::{D, TURN};
use super::state::{Body, Member};
use crate::fit::tube::Rows;
use crate::model::Species;
use crate::traits::{Sigma, Sigmas, keys};

/// Standard deviations that the data do not tell, because the model itself is off: stems taper and swell at nodes.
/// Shares of the value for lengths and diameters, radians for angles (guesses).
const BIAS: [(&str, f64); 6] = [
    (keys::STEM_LENGTH, 0.01),
    (keys::STEM_DIAMETER, 0.1),
    (keys::PETIOLE_LENGTH, 0.03),
    (keys::INTERNODE_LENGTH, 0.05),
    (keys::PETIOLE_ANGLE, 0.03),
    (keys::STEM_LEAN, 0.005),
];
/// Factor on the covariance for what its linear form leaves out, as stage 1 has it for blades.
const INFLATION: f64 = 3.0;

/// The uncertainty of a stem's traits, and of where an organ hangs; `parent` is the path length of what carries it in
/// metres.
pub(super) fn sigmas(member: &Member, covariance: &DMatrix<f64>, parent: Option<f64>, species: &Species) -> Sigmas {
    let variance = |i: usize| INFLATION * covariance[(i, i)];
    let mut data: Vec<(&'static str, f64)> = Vec::new();
    if let Some(metres) = parent {
        // An internode lies between two organs that are about as sure.
        data.push((keys::INTERNODE_LENGTH, metres * (2.0 * variance(D)).sqrt()));
    }
    if let Body::Tube(tube) = &member.body {
        let length = tube.metres() * variance(TURN + 3).sqrt();
        let diameter = 2.0 * tube.radius() * variance(covariance.nrows() - 1).sqrt();
        let axis = Rows::of(tube, species).axis;
        let chord = (axis[axis.len() - 1] - axis[0]).normalize_or(DVec3::Z).to_array();
        // Of the turn, the part about the chord moves nothing.
        let turn = INFLATION * covariance.view((TURN, TURN), (3, 3));
        let about: f64 = (0..9).map(|k| chord[k / 3] * turn[(k / 3, k % 3)] * chord[k % 3]).sum();
        let angle = ((turn.trace() - about) / 2.0).max(0.0).sqrt();
        data.extend([(keys::STEM_LENGTH, length), (keys::PETIOLE_LENGTH, length), (keys::STEM_DIAMETER, diameter)]);
        data.extend([(keys::PETIOLE_ANGLE, angle), (keys::STEM_LEAN, angle)]);
    }
    let model = |key| BIAS.iter().find(|(of, _)| *of == key).map_or(0.0, |(_, bias)| *bias);
    let finite = data.into_iter().filter(|(_, data)| data.is_finite());
    finite.map(|(key, data)| (key, Sigma { data, model: model(key) })).collect()
}
