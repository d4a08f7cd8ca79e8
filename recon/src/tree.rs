//! Organs to a tree (paper supp. "Tree-structure recovery"): the minimum spanning arborescence from the main stem.

use glam::DVec3;

use crate::cloud::thinned;
use crate::model::OrganKind;
use crate::nearest::Nearest;
use crate::organs::{OrganCloud, OrganTree};

/// Share of an organ's points that may lie nearer to another organ than their distance says: the release's first
/// percentile, robust against strays.
const STRAY_SHARE: f64 = 0.01;
/// Points of one organ that its distances are taken from: on a stem 1 m long and 2 cm thick they lie 8 mm apart.
const MAX_POINTS: usize = 1_000;

/// Why organs make no tree.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum TreeError {
    /// No main stem, or several.
    #[error("expected exactly one main stem, found {found}")]
    MainStems {
        /// How many.
        found: usize,
    },
    /// An organ without points has no distance to others.
    #[error("organ {organ}: expected points, found none")]
    NoPoints {
        /// Which.
        organ: usize,
    },
}

/// Builds the tree. Leaves have no children, so the arborescence is Prim's tree over the stems with each leaf on its
/// nearest stem.
///
/// # Errors
/// [`TreeError`] without exactly one main stem, or for an organ without points.
pub fn build(organs: Vec<OrganCloud>) -> Result<OrganTree, TreeError> {
    let mains: Vec<usize> = (0..organs.len()).filter(|i| organs[*i].kind == OrganKind::MainStem).collect();
    let &[main] = mains.as_slice() else { return Err(TreeError::MainStems { found: mains.len() }) };
    if let Some(organ) = organs.iter().position(|o| o.points.is_empty()) {
        return Err(TreeError::NoPoints { organ });
    }
    // Distance of every organ to the tree so far, and the stem that is that near.
    let mut nearest = vec![(f64::INFINITY, main); organs.len()];
    let mut order = vec![main];
    let mut inside = vec![false; organs.len()];
    inside[main] = true;
    let mut newest = main;
    let extents: Vec<Extent> = organs.iter().map(|o| Extent::of(&o.points)).collect();
    loop {
        let search = Nearest::of(&extents[newest].points);
        for (i, organ) in extents.iter().enumerate() {
            if !inside[i] && organ.box_distance(&extents[newest]) < nearest[i].0 {
                let gap = gap(&organ.points, &search);
                if gap < nearest[i].0 {
                    nearest[i] = (gap, newest);
                }
            }
        }
        let stems = (0..organs.len()).filter(|i| !inside[*i] && organs[*i].kind != OrganKind::Leaf);
        let Some(next) = stems.min_by(|a, b| nearest[*a].0.total_cmp(&nearest[*b].0)) else { break };
        inside[next] = true;
        order.push(next);
        newest = next;
    }
    order.extend((0..organs.len()).filter(|i| organs[*i].kind == OrganKind::Leaf));
    let mut rank = vec![0; organs.len()];
    for (k, i) in order.iter().enumerate() {
        rank[*i] = k;
    }
    let parent = order.iter().map(|i| (*i != main).then(|| rank[nearest[*i].1])).collect();
    let mut slots: Vec<Option<OrganCloud>> = organs.into_iter().map(Some).collect();
    Ok(OrganTree { organs: order.iter().filter_map(|i| slots[*i].take()).collect(), parent })
}

/// Where an organ is.
struct Extent {
    /// At most [`MAX_POINTS`].
    points: Vec<DVec3>,
    low: DVec3,
    high: DVec3,
}

impl Extent {
    fn of(points: &[DVec3]) -> Self {
        let points = thinned(points, MAX_POINTS);
        let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        Self { points, low, high }
    }

    /// Distance between two bounding boxes, metres: no two of their points are nearer. It spares most pairs of organs
    /// their nearest neighbours, so that the tree's cost grows with the organs and not with their square.
    fn box_distance(&self, other: &Self) -> f64 {
        (self.low - other.high).max(other.low - self.high).max(DVec3::ZERO).length()
    }
}

/// Distance between two organs, metres.
fn gap(points: &[DVec3], other: &Nearest) -> f64 {
    let mut all: Vec<f64> = points.iter().filter_map(|p| other.one(*p)).map(|n| n.distance()).collect();
    let stray = (all.len() as f64 * STRAY_SHARE) as usize;
    if stray < all.len() { *all.select_nth_unstable_by(stray, f64::total_cmp).1 } else { f64::INFINITY }
}

/// Takes out stems that carry no leaf, however far up: noise of single views (paper supp. "2D Reconstruction"). The
/// main stem stays.
#[must_use]
pub fn without_bare_stems(tree: OrganTree) -> OrganTree {
    let mut carries: Vec<bool> = tree.organs.iter().map(|o| o.kind != OrganKind::Stem).collect();
    for i in (0..tree.organs.len()).rev() {
        if let Some(parent) = tree.parent[i] {
            carries[parent] |= carries[i];
        }
    }
    let mut kept = OrganTree { organs: Vec::new(), parent: Vec::new() };
    let mut rank = vec![0; carries.len()];
    for (i, (organ, parent)) in tree.organs.into_iter().zip(tree.parent).enumerate() {
        if carries[i] {
            rank[i] = kept.organs.len();
            kept.organs.push(organ);
            kept.parent.push(parent.map(|p| rank[p]));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(kind: OrganKind, from: DVec3, to: DVec3) -> OrganCloud {
        let points: Vec<DVec3> = (0..50).map(|i| from.lerp(to, f64::from(i) / 49.0)).collect();
        OrganCloud { kind, source: (0..50).collect(), points }
    }

    #[test]
    fn leaves_hang_on_their_petioles_and_bare_stems_go() {
        let organs = vec![
            line(OrganKind::Leaf, DVec3::new(0.3, 0.0, 0.5), DVec3::new(0.4, 0.0, 0.5)),
            line(OrganKind::Stem, DVec3::new(0.01, 0.0, 0.3), DVec3::new(0.29, 0.0, 0.5)),
            line(OrganKind::Stem, DVec3::new(-0.01, 0.0, 0.4), DVec3::new(-0.2, 0.0, 0.5)),
            line(OrganKind::MainStem, DVec3::ZERO, DVec3::Z),
        ];
        let tree = build(organs.clone()).expect("one main stem");
        let kinds: Vec<OrganKind> = tree.organs.iter().map(|o| o.kind).collect();
        assert_eq!(kinds, [OrganKind::MainStem, OrganKind::Stem, OrganKind::Stem, OrganKind::Leaf]);
        assert_eq!(tree.parent[0], None);
        let leaf_parent = &tree.organs[tree.parent[3].expect("hangs")];
        assert!(leaf_parent.points[0].x > 0.0, "the leaf hangs on the petiole at its side");
        let pruned = without_bare_stems(tree);
        assert_eq!((pruned.organs.len(), &pruned.parent), (3, &vec![None, Some(0), Some(1)]));
        assert_eq!(build(organs[..3].to_vec()), Err(TreeError::MainStems { found: 0 }));
    }
}
