//! Plants between two plants of the same topology.

use demeter_frame::Pose;
use glam::DQuat;

use super::EditError;
use crate::model::leaf::Blade;
use crate::model::{Form, Joint, Organ, Plant};

/// The plant at `t` on the way from `first` (0) to `second` (1): rotations by slerp, sizes, radii and widths by their
/// logarithms, all else in a straight line. Leaves keep the numbers that they have in `first`.
///
/// # Errors
/// [`EditError::Topology`] naming the first organ whose parent or kind differs, or `t` outside 0..=1.
pub fn between(first: &Plant, second: &Plant, t: f64) -> Result<Plant, EditError> {
    if !(0.0..=1.0).contains(&t) {
        return Err(EditError::Number { what: "t", expected: "in 0..=1", found: t });
    }
    let counts = [first, second].map(|plant| plant.organs.len());
    let pairs = first.organs.iter().zip(&second.organs).enumerate();
    let organs = pairs.map(|(i, (a, b))| organ(i, a, b, t)).collect::<Result<Vec<_>, _>>()?;
    if counts[0] != counts[1] {
        return Err(differ(organs.len(), "number of organs", counts[0], counts[1]));
    }
    let (a, b) = (&first.world_from_plant, &second.world_from_plant);
    let world_from_plant = Pose::new(turn(a.rotation, b.rotation, t), a.translation.lerp(b.translation, t));
    let plant = Plant { world_from_plant, organs };
    plant.validate()?;
    Ok(plant)
}

fn differ(organ: usize, what: &'static str, first: impl std::fmt::Debug, second: impl std::fmt::Debug) -> EditError {
    EditError::Topology { organ, what, first: format!("{first:?}"), second: format!("{second:?}") }
}

fn organ(index: usize, a: &Organ, b: &Organ, t: f64) -> Result<Organ, EditError> {
    if a.parent != b.parent {
        return Err(differ(index, "parent", a.parent, b.parent));
    }
    let form = match (&a.form, &b.form) {
        (Form::Stem { gamma, radius }, Form::Stem { gamma: other, radius: wider }) => {
            Form::Stem { gamma: mix(gamma, other, t), radius: ratio(*radius, *wider, t) }
        }
        (Form::Leaf { blade: a, leaf }, Form::Leaf { blade: b, .. }) => {
            let (beta, gamma) = (mix(&a.beta, &b.beta, t), mix(&a.gamma, &b.gamma, t));
            Form::Leaf { blade: Blade { beta, gamma, width: ratio(a.width, b.width, t) }, leaf: *leaf }
        }
        _ => return Err(differ(index, "kind", a.kind(), b.kind())),
    };
    let joint = Joint {
        // Rounding may carry it over its bound.
        d: (a.joint.d + (b.joint.d - a.joint.d) * t).clamp(0.0, 1.0),
        rotation: turn(a.joint.rotation, b.joint.rotation, t),
        scale: ratio(a.joint.scale, b.joint.scale, t),
    };
    Ok(Organ { parent: a.parent, joint, form })
}

/// Coefficients on the straight line; missing trailing ones count as 0.
fn mix(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    let at = |c: &[f64], k: usize| c.get(k).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|k| at(a, k) + (at(b, k) - at(a, k)) * t).collect()
}

fn ratio(a: f64, b: f64, t: f64) -> f64 {
    (a.ln() + (b.ln() - a.ln()) * t).exp()
}

fn turn(a: DQuat, b: DQuat, t: f64) -> DQuat {
    let q = a.slerp(b, t).normalize();
    if q.w < 0.0 { -q } else { q }
}
