//! Grasses without labels: the whole plant is one skeleton; the trunk up to its last fork is the main stem, every
//! path that leaves it is a leaf, and so are the trunk's end and what a network takes for leaves.

use glam::DVec3;

use super::broadleaf::VOTERS;
use super::unlabelled::Evidence;
use super::{MIN_ORGAN_POINTS, grain, nearest_to, organ};
use crate::graph::{CloudGraph, Skeleton, pieces, prune};
use crate::model::OrganKind;
use crate::nearest::Nearest;
use crate::organs::OrganCloud;

/// Shortest path that counts as a leaf, as a share of the bounding box diagonal (a guess: shorter ones are spurs).
const LEAF_SHARE: f64 = 0.06;
/// Share of the cloud's points that is the least leaf a network may add (a guess).
const LEAST_SHARE: f64 = 1.0 / 200.0;

pub(super) fn segment(points: &[DVec3], foot: DVec3, up: DVec3, evidence: Option<&Evidence>) -> Vec<OrganCloud> {
    let search = Nearest::of(points);
    let grain = grain(points, &search, 10);
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
    let leafy = evidence.map_or_else(Vec::new, |e| leafy(points, &search, &mut stem, e, 2.0 * grain));
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
    rejoin(points, &mut leaves, leafy, 2.0 * grain);
    organs
        .extend(leaves.into_iter().filter(|m| m.len() >= MIN_ORGAN_POINTS).map(|m| organ(points, OrganKind::Leaf, m)));
    organs
}

/// Takes out of the stem what a network takes for leaves, unless that is all of it; `reach` joins neighbours, metres.
fn leafy(
    points: &[DVec3],
    search: &Nearest,
    stem: &mut Vec<usize>,
    evidence: &Evidence,
    reach: f64,
) -> Vec<Vec<usize>> {
    let near = |i: usize| search.k(points[i], VOTERS).into_iter();
    let mut is_leafy = vec![false; points.len()];
    for i in stem.iter() {
        is_leafy[*i] = evidence.leaf_among(&near(*i).map(|n| n.index).collect::<Vec<_>>()) > 0.5;
    }
    let joined = |i: usize| near(i).filter(move |n| n.distance() < reach).map(|n| n.index);
    let mut parts = pieces(points.len(), joined, |i| is_leafy[i]);
    let least = MIN_ORGAN_POINTS.max((LEAST_SHARE * points.len() as f64) as usize);
    parts.retain(|part| part.len() >= least);
    if stem.len() < parts.iter().map(Vec::len).sum::<usize>() + MIN_ORGAN_POINTS {
        return Vec::new();
    }
    let mut stays = vec![true; points.len()];
    parts.iter().flatten().for_each(|i| stays[*i] = false);
    stem.retain(|i| stays[*i]);
    parts
}

/// Gives each part to the leaf that it touches most, else makes it a leaf.
fn rejoin(points: &[DVec3], leaves: &mut Vec<Vec<usize>>, parts: Vec<Vec<usize>>, reach: f64) {
    let owned: Vec<(usize, usize)> =
        leaves.iter().enumerate().flat_map(|(k, leaf)| leaf.iter().map(move |i| (*i, k))).collect();
    let search = Nearest::of(&owned.iter().map(|(i, _)| points[*i]).collect::<Vec<_>>());
    for part in parts {
        let mut touching = vec![0; leaves.len()];
        let near = part.iter().filter_map(|i| search.one(points[*i])).filter(|n| n.distance() < reach);
        near.for_each(|n| touching[owned[n.index].1] += 1);
        match (0..touching.len()).max_by_key(|k| touching[*k]).filter(|k| touching[*k] > 0) {
            Some(k) => leaves[k].extend(part),
            None => leaves.push(part),
        }
    }
}

fn nearest_level(centres: &[DVec3], p: DVec3) -> usize {
    (0..centres.len())
        .fold(0, |best, k| if centres[k].distance_squared(p) < centres[best].distance_squared(p) { k } else { best })
}
