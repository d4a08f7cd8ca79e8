//! How sure stems' traits are: the covariance of stage 2, every organ's with that of all below it.

use glam::DVec3;
use nalgebra::DMatrix;

use super::elimination::{D, TURN};
use super::state::{Body, Member};
use crate::fit::tube::Rows;
use crate::fit::uncertainty;
use crate::model::Species;
use crate::traits::{Sigmas, keys};

/// The uncertainty of a stem's traits, and of where an organ hangs; `parent` is the path length of what carries it in
/// metres.
pub(super) fn sigmas(member: &Member, covariance: &DMatrix<f64>, parent: Option<f64>, species: &Species) -> Sigmas {
    let mut variances: Vec<(&'static str, f64)> = Vec::new();
    if let Some(metres) = parent {
        // An internode lies between two organs that are about as sure.
        variances.push((keys::INTERNODE_LENGTH, 2.0 * metres.powi(2) * covariance[(D, D)]));
    }
    if let Body::Tube(tube) = &member.body {
        let last = covariance.nrows() - 1;
        let length = tube.metres().powi(2) * covariance[(TURN + 3, TURN + 3)];
        let diameter = (2.0 * tube.radius()).powi(2) * covariance[(last, last)];
        let axis = Rows::of(tube, species).axis;
        let chord = (axis[axis.len() - 1] - axis[0]).normalize_or(DVec3::Z).to_array();
        // Of the turn, the part about the chord moves nothing.
        let turn = covariance.view((TURN, TURN), (3, 3));
        let about: f64 = (0..9).map(|k| chord[k / 3] * turn[(k / 3, k % 3)] * chord[k % 3]).sum();
        let angle = ((turn.trace() - about) / 2.0).max(0.0);
        variances.extend([
            (keys::STEM_LENGTH, length),
            (keys::PETIOLE_LENGTH, length),
            (keys::STEM_DIAMETER, diameter),
        ]);
        variances.extend([(keys::PETIOLE_ANGLE, angle), (keys::STEM_LEAN, angle)]);
    }
    uncertainty::sigmas(variances)
}
