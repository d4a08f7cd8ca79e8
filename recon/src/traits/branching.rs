//! Traits that come from how organs hang on each other, and those of stems.

use glam::DVec3;

use super::{Traits, Unit, keys, put};
use crate::model::{Form, Plant, PosedPlant};

/// Two attachments closer than this, in path lengths of the stem, are at one node.
const NODE: f64 = 1.0 / 200.0;

/// True when attachments `low` <= `high` on one stem are at one node.
pub(super) fn share_a_node(low: f64, high: f64) -> bool {
    high - low < NODE
}

/// Which leaves an organ carries.
#[derive(Clone, Copy, PartialEq)]
enum Carries {
    Nothing,
    One(u16),
    Many,
}

impl Carries {
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Nothing, more) | (more, Self::Nothing) => more,
            (a, b) if a == b => a,
            _ => Self::Many,
        }
    }
}

/// Traits of every organ but those of a blade's surface.
pub(super) fn traits(plant: &Plant, posed: &PosedPlant) -> Vec<Traits> {
    let mut carries: Vec<Carries> = plant
        .organs
        .iter()
        .map(|organ| match organ.form {
            Form::Leaf { leaf, .. } => Carries::One(leaf),
            Form::Stem { .. } => Carries::Nothing,
        })
        .collect();
    for i in (1..plant.organs.len()).rev() {
        if let Some(parent) = plant.organs[i].parent {
            carries[parent] = carries[parent].and(carries[i]);
        }
    }
    // A stem is a leaf's own when it carries that leaf alone; the main stem never is.
    let of_a_leaf = |i: usize| i > 0 && matches!(carries[i], Carries::One(_));
    let children = plant.children();
    let mut order = vec![0_u16; plant.organs.len()];
    let mut all = vec![Traits::new(); plant.organs.len()];
    for (i, organ) in plant.organs.iter().enumerate() {
        let traits = &mut all[i];
        let size = posed.world_from_organ[i].scale;
        let is_stem = matches!(organ.form, Form::Stem { .. });
        if is_stem {
            put(traits, keys::STEM_LENGTH, size, Unit::Metre);
            put(traits, keys::STEM_DIAMETER, 2.0 * posed.radius[i], Unit::Metre);
        }
        let chord = posed.control[i][posed.control[i].len() - 1] - posed.control[i][0];
        let Some(parent) = organ.parent else {
            put(traits, keys::BRANCH_ORDER, 0.0, Unit::One);
            put_angle(traits, keys::STEM_LEAN, chord, DVec3::Z);
            continue;
        };
        order[i] = order[parent] + 1;
        put(traits, keys::BRANCH_ORDER, order[i].into(), Unit::One);
        if of_a_leaf(parent) {
            continue;
        }
        let mut below = 0.0;
        for other in &children[parent] {
            let d = plant.organs[*other].joint.d;
            if d < organ.joint.d && !share_a_node(d, organ.joint.d) {
                below = d.max(below);
            }
        }
        let path = posed.world_from_organ[parent].scale;
        put(traits, keys::INTERNODE_LENGTH, (organ.joint.d - below) * path, Unit::Metre);
        if is_stem && of_a_leaf(i) {
            let first = children[i].iter().map(|child| plant.organs[*child].joint.d).fold(1.0, f64::min);
            put(traits, keys::PETIOLE_LENGTH, first * size, Unit::Metre);
            let stem = direction(&posed.control[parent], organ.joint.d);
            put_angle(traits, keys::PETIOLE_ANGLE, chord, stem);
        }
    }
    all
}

/// Direction of a stem towards its tip at `d`: that of the bone there.
pub(super) fn direction(control: &[DVec3], d: f64) -> DVec3 {
    let bones = control.len() - 1;
    let bone = ((d * bones as f64) as usize).min(bones - 1);
    control[bone + 1] - control[bone]
}

fn put_angle(traits: &mut Traits, key: &str, a: DVec3, b: DVec3) {
    let angle = a.angle_between(b);
    if angle.is_finite() {
        put(traits, key, angle, Unit::Radian);
    }
}
