//! Grasses without labels: the whole plant is one skeleton; the trunk up to its last fork is the main stem, every
//! path that leaves it is a leaf, and so is the trunk's end.

use glam::DVec3;

use super::{MIN_ORGAN_POINTS, grain, nearest_to, organ};
use crate::graph::{CloudGraph, Skeleton, prune};
use crate::model::OrganKind;
use crate::nearest::Nearest;
use crate::organs::OrganCloud;

/// Shortest path that counts as a leaf, as a share of the bounding box diagonal (a guess: shorter ones are spurs).
const LEAF_SHARE: f64 = 0.06;

pub(super) fn segment(points: &[DVec3], foot: DVec3, up: DVec3) -> Vec<OrganCloud> {
    let grain = grain(points, &Nearest::of(points), 10);
    let diagonal = crate::cloud::diagonal(points).unwrap_or(0.0);
    let graph = CloudGraph::new(points);
    let base = nearest_to(points, foot);
    let branches = Skeleton::of(points, &graph, base, 2.0 * grain).branches(|centre, _| centre.dot(up));
    let branches = prune(branches, points, (LEAF_SHARE * diagonal).max(4.0 * grain));
    let trunk = &branches[0];
    // The level of the trunk from which its last leaf leaves.
    let fork = branches[1..]
        .iter()
        .filter(|b| b.parent == Some(0))
        .map(|b| nearest_level(&trunk.centres, b.centres[0]))
        .max()
        .unwrap_or(trunk.centres.len() / 2)
        .clamp(1, trunk.centres.len());
    let (mut stem, mut top) = (Vec::new(), Vec::new());
    for i in &trunk.members {
        let level = nearest_level(&trunk.centres, points[*i]);
        if level <= fork { stem.push(*i) } else { top.push(*i) }
    }
    if top.len() < MIN_ORGAN_POINTS {
        stem.append(&mut top);
    }
    let mut organs = vec![organ(points, OrganKind::MainStem, stem)];
    // A path that leaves a leaf is part of it.
    let mut owner: Vec<usize> = Vec::with_capacity(branches.len());
    let mut leaves: Vec<Vec<usize>> = vec![top];
    for (k, branch) in branches.iter().enumerate() {
        owner.push(match branch.parent {
            None => 0,
            Some(0) => {
                leaves.push(Vec::new());
                leaves.len() - 1
            }
            Some(parent) => owner[parent],
        });
        if k > 0 {
            leaves[owner[k]].extend(&branch.members);
        }
    }
    organs
        .extend(leaves.into_iter().filter(|m| m.len() >= MIN_ORGAN_POINTS).map(|m| organ(points, OrganKind::Leaf, m)));
    organs
}

fn nearest_level(centres: &[DVec3], p: DVec3) -> usize {
    (0..centres.len())
        .fold(0, |best, k| if centres[k].distance_squared(p) < centres[best].distance_squared(p) { k } else { best })
}
