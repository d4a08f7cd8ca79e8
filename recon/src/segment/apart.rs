//! Clouds whose organs are apart already, stems too: nothing is left to divide.

use std::collections::BTreeMap;

use glam::DVec3;

use super::{SegmentError, Segmented, Up, is_fittable, organ};
use crate::cloud::PointOrgan;
use crate::model::OrganKind;

pub(super) fn segment(points: &[DVec3], organs: &[PointOrgan], up: Up) -> Result<Segmented, SegmentError> {
    let mut members: BTreeMap<i32, (OrganKind, Vec<usize>)> = BTreeMap::new();
    for (i, point) in organs.iter().enumerate().take(points.len()).filter(|(_, o)| o.organ >= 0) {
        let (kind, members) = members.entry(point.organ).or_insert((point.kind, Vec::new()));
        if *kind != point.kind {
            return Err(SegmentError::Kinds { organ: point.organ });
        }
        members.push(i);
    }
    let is_stem: Vec<bool> = organs.iter().map(|o| o.organ >= 0 && o.kind != OrganKind::Leaf).collect();
    let (up, _) = up.resolve(points, Some(&is_stem));
    let organs = members.into_values().map(|(kind, members)| organ(points, kind, members)).filter(is_fittable);
    Ok(Segmented { organs: organs.collect(), up })
}
