//! Priors of articulation from plants: how long, how steep, how far up and how thick organs are on their parents.

use glam::DVec3;

use crate::model::{Form, JointPrior, Normal, OrganKind, Plant, Priors};

/// How one organ hangs on its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hanging {
    /// Stem or leaf.
    pub kind: OrganKind,
    /// ln of its size relative to its parent's path length.
    pub ln_scale: f64,
    /// Angle of its chord to the parent's direction, radians.
    pub inclination: f64,
    /// Fraction of the parent's path length.
    pub attachment: f64,
    /// ln of a stem's radius relative to its parent's; of a blade, ln s_x.
    pub ln_breadth: f64,
}

/// Every organ of a plant but its main stem.
pub(super) fn hanging(plant: &Plant) -> Vec<Hanging> {
    let radius = |organ: usize| match &plant.organs[organ].form {
        Form::Stem { radius, .. } => *radius,
        Form::Leaf { .. } => f64::NAN,
    };
    let hung = plant.organs.iter().filter_map(|organ| Some((organ, organ.parent?)));
    hung.map(|(organ, parent)| Hanging {
        kind: organ.kind(),
        ln_scale: organ.joint.scale.ln(),
        inclination: (organ.joint.rotation * DVec3::Y).angle_between(DVec3::Y),
        attachment: organ.joint.d,
        ln_breadth: match &organ.form {
            // Radii are in units of each stem's own length.
            Form::Stem { radius: own, .. } => (own * organ.joint.scale / radius(parent)).ln(),
            Form::Leaf { blade, .. } => blade.width.ln(),
        },
    })
    .collect()
}

/// The priors of organs that hang so; kinds of which there are too few keep what `before` says.
pub(super) fn priors(hanging: &[Hanging], before: &Priors) -> Priors {
    let of = |kind: OrganKind, value: fn(&Hanging) -> f64, before: Normal| {
        let values: Vec<f64> = hanging.iter().filter(|h| h.kind == kind).map(value).collect();
        let learned = Normal::of(&values);
        if learned == Normal::UNKNOWN { before } else { learned }
    };
    let joint = |kind, before: JointPrior| JointPrior {
        ln_scale: of(kind, |h| h.ln_scale, before.ln_scale),
        inclination: of(kind, |h| h.inclination, before.inclination),
        attachment: of(kind, |h| h.attachment, before.attachment),
    };
    Priors {
        blade: joint(OrganKind::Leaf, before.blade),
        stem: joint(OrganKind::Stem, before.stem),
        ln_thickness: of(OrganKind::Stem, |h| h.ln_breadth, before.ln_thickness),
        ln_width: of(OrganKind::Leaf, |h| h.ln_breadth, before.ln_width),
    }
}
