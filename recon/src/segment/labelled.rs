//! Labels say which points are stems and which leaf each other point belongs to; all stems share one label and are
//! taken apart along their skeleton.

use std::collections::BTreeMap;

use glam::DVec3;

use super::{MIN_ORGAN_POINTS, SegmentError, Segmented, Up, is_fittable, organ, split_stems};
use crate::model::OrganKind;

pub(super) fn segment(points: &[DVec3], labels: &[i32], up: Up) -> Result<Segmented, SegmentError> {
    let mut members: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
    for (i, label) in labels.iter().enumerate().take(points.len()) {
        members.entry(*label.max(&0)).or_default().push(i);
    }
    let stems = members.remove(&0).unwrap_or_default();
    if stems.len() < MIN_ORGAN_POINTS {
        return Err(SegmentError::Labels { found: "fewer than 12 points labelled 0 (stems)" });
    }
    let mut is_stem = vec![false; points.len()];
    for i in &stems {
        is_stem[*i] = true;
    }
    let (up, foot) = up.resolve(points, Some(&is_stem));
    let mut organs = split_stems(points, &stems, foot.point, up);
    let leaves = members.into_values().filter(|m| m.len() >= MIN_ORGAN_POINTS);
    organs.extend(leaves.map(|m| organ(points, OrganKind::Leaf, m)));
    organs.retain(is_fittable);
    Ok(Segmented { organs, up })
}
