//! Labels say which points are stems and which leaf each other point belongs to; all stems share one label and are
//! taken apart along their skeleton.

use std::collections::BTreeMap;

use glam::DVec3;

use super::{MIN_ORGAN_POINTS, Segmented, Up, grass, is_fittable, organ, stems};
use crate::model::{Habit, OrganKind};

pub(super) fn segment(points: &[DVec3], labels: &[i32], habit: Habit, up: Up) -> Segmented {
    let mut members: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
    for (i, label) in labels.iter().enumerate().take(points.len()) {
        members.entry(*label.max(&0)).or_default().push(i);
    }
    let mut trunk = members.remove(&0).unwrap_or_default();
    let mut is_stem = vec![false; points.len()];
    trunk.iter().for_each(|i| is_stem[*i] = true);
    let known = trunk.len() >= MIN_ORGAN_POINTS;
    let (up, foot) = up.resolve(points, known.then_some(is_stem.as_slice()));
    if !known {
        // Leaves hide the stem, or their sheaths are labelled as they are: it is what a whole plant's skeleton says.
        trunk = grass::segment(points, foot.point, up, None)
            .swap_remove(0)
            .source
            .into_iter()
            .map(|i| i as usize)
            .collect();
        trunk.iter().for_each(|i| is_stem[*i] = true);
        members.values_mut().for_each(|leaf| leaf.retain(|i| !is_stem[*i]));
    }
    let leaves: Vec<Vec<usize>> = members.into_values().filter(|m| m.len() >= MIN_ORGAN_POINTS).collect();
    let mut organs = stems::split(points, &trunk, &leaves, foot.point, habit, None);
    organs.extend(leaves.into_iter().map(|m| organ(points, OrganKind::Leaf, m)));
    organs.retain(is_fittable);
    Segmented { organs, up }
}
