//! Organs to a tree (paper supp. "Tree-structure recovery"): the minimum spanning arborescence from the main stem.

use glam::DVec3;

use crate::cloud::thinned;
use crate::model::OrganKind;
use crate::nearest::{Nearest, Neighbour};
use crate::organs::{OrganCloud, OrganTree};
use crate::statistics::median;

/// Share of an organ's points that may lie nearer to another organ than their distance says: the release's first
/// percentile, robust against strays.
const STRAY_SHARE: f64 = 0.01;
/// What it costs to hang an organ by its middle, as a share of how much farther its ends are from each other than from
/// the joint: enough to tell a blade that touches a strange petiole from one that grows there, little beside a gap
/// (a guess, as the next two; half and twice of each changes up to two parents in a hundred on soybeans and beans).
const MIDDLE_COST: f64 = 0.3;
/// What it costs to hang a blade on a stem's side, as a share of the distance to the stem's end.
const TIP_COST: f64 = 0.1;
/// Share of a stem's length, from where it hangs, that carries nothing: what starts there has its joint beside it.
const FOOT_SHARE: f64 = 0.3;
/// Largest spacing of a stem that excuses a gap, as a share of its length: a few points tell nothing.
const SPACING_SHARE: f64 = 0.03;
/// Points of a stem that tell its spacing.
const SPACING_SAMPLES: usize = 64;
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
/// cheapest stem; what it costs to hang an organ on a stem is in [`Joint`].
///
/// # Errors
/// [`TreeError`] without exactly one main stem, or for an organ without points.
pub fn build(organs: Vec<OrganCloud>) -> Result<OrganTree, TreeError> {
    let mains: Vec<usize> = (0..organs.len()).filter(|i| organs[*i].kind == OrganKind::MainStem).collect();
    let &[main] = mains.as_slice() else { return Err(TreeError::MainStems { found: mains.len() }) };
    if let Some(organ) = organs.iter().position(|o| o.points.is_empty()) {
        return Err(TreeError::NoPoints { organ });
    }
    let shapes: Vec<Shape> = organs.iter().map(Shape::of).collect();
    // The cheapest joint of every organ with the tree so far, and the stem that it is on.
    let mut cheapest: Vec<(Joint, usize)> = vec![(Joint { cost: f64::INFINITY, at: DVec3::ZERO }, main); organs.len()];
    let mut order = vec![main];
    let mut inside = vec![false; organs.len()];
    inside[main] = true;
    let mut newest = main;
    loop {
        let stem = Stem::of(&shapes[newest], (newest != main).then_some(cheapest[newest].0.at));
        for (i, shape) in shapes.iter().enumerate().filter(|(i, _)| !inside[*i]) {
            if let Some(joint) = stem.joint(shape, cheapest[i].0.cost) {
                cheapest[i] = (joint, newest);
            }
        }
        let stems = (0..organs.len()).filter(|i| !inside[*i] && organs[*i].kind != OrganKind::Leaf);
        let Some(next) = stems.min_by(|a, b| cheapest[*a].0.cost.total_cmp(&cheapest[*b].0.cost)) else { break };
        inside[next] = true;
        order.push(next);
        newest = next;
    }
    order.extend((0..organs.len()).filter(|i| organs[*i].kind == OrganKind::Leaf));
    let mut rank = vec![0; organs.len()];
    for (k, i) in order.iter().enumerate() {
        rank[*i] = k;
    }
    let parent = order.iter().map(|i| (*i != main).then(|| rank[cheapest[*i].1])).collect();
    let mut slots: Vec<Option<OrganCloud>> = organs.into_iter().map(Some).collect();
    Ok(OrganTree { organs: order.iter().filter_map(|i| slots[*i].take()).collect(), parent })
}

/// How an organ would hang on a stem.
#[derive(Clone, Copy, Debug)]
struct Joint {
    /// The gap between them, metres, plus what is odd about the place: an organ hangs by its end and not by its
    /// middle, on a stem's far end or its side and not at its foot, and a blade on a petiole's far end.
    cost: f64,
    /// The place: the mean of the organ's points that cost least.
    at: DVec3,
}

/// What the tree needs to know of an organ.
struct Shape {
    kind: OrganKind,
    /// Some of its points.
    points: Vec<DVec3>,
    low: DVec3,
    high: DVec3,
    ends: [DVec3; 2],
}

impl Shape {
    fn of(organ: &OrganCloud) -> Self {
        let points = thinned(&organ.points, MAX_POINTS);
        let fold = |f: fn(DVec3, DVec3) -> DVec3| points.iter().copied().reduce(f).unwrap_or_default();
        Self { kind: organ.kind, low: fold(DVec3::min), high: fold(DVec3::max), ends: ends(&points), points }
    }
}

/// A stem of the growing tree.
struct Stem<'a> {
    shape: &'a Shape,
    search: Nearest,
    /// Median distance to the third neighbour, metres: a gap below it says nothing.
    spacing: f64,
    /// The end by which it hangs and the other, `None` for the main stem.
    ends: Option<(DVec3, DVec3)>,
}

impl<'a> Stem<'a> {
    fn of(shape: &'a Shape, at: Option<DVec3>) -> Self {
        let search = Nearest::of(&shape.points);
        let some = thinned(&shape.points, SPACING_SAMPLES).into_iter();
        let spacing = median(some.filter_map(|p| search.k(p, 4).last().map(Neighbour::distance)));
        let [a, b] = shape.ends;
        let hung = |at: DVec3| if at.distance(a) < at.distance(b) { (a, b) } else { (b, a) };
        let spacing = spacing.unwrap_or(0.0).min(SPACING_SHARE * a.distance(b));
        Self { shape, search, spacing, ends: at.map(hung) }
    }

    /// The joint with an organ, when it costs less than `bound`.
    fn joint(&self, organ: &Shape, bound: f64) -> Option<Joint> {
        let ends = organ.ends;
        let least = (organ.points.len() as f64 * STRAY_SHARE) as usize;
        let cost = |p: DVec3| {
            let gap = (self.search.one(p)?.distance() - self.spacing).max(0.0);
            let place = self.ends.map_or(0.0, |(base, tip)| {
                let foot = (FOOT_SHARE * base.distance(tip) - base.distance(p)).max(0.0);
                let side = if organ.kind == OrganKind::Leaf { TIP_COST * tip.distance(p) } else { 0.0 };
                foot + side
            });
            Some((gap + middle_cost(p, ends) + place, p))
        };
        // What lies farther from the stem's box than the bound needs no search.
        let reach = bound + self.spacing;
        let outside = (organ.low - self.shape.high).max(self.shape.low - organ.high).max(DVec3::ZERO);
        if outside.length() >= reach {
            return None;
        }
        let in_reach = organ.points.iter().filter(|p| p.distance(p.clamp(self.shape.low, self.shape.high)) < reach);
        let mut found: Vec<(f64, DVec3)> = in_reach.filter_map(|p| cost(*p)).collect();
        if found.len() <= least {
            return None;
        }
        found.select_nth_unstable_by(least, |a, b| a.0.total_cmp(&b.0));
        let at = found[..=least].iter().map(|(_, p)| *p).sum::<DVec3>() / (least + 1) as f64;
        (found[least].0 < bound).then_some(Joint { cost: found[least].0, at })
    }
}

fn farthest(points: &[DVec3], from: DVec3) -> DVec3 {
    let farther = |a: DVec3, b: DVec3| if b.distance_squared(from) > a.distance_squared(from) { b } else { a };
    points.iter().copied().fold(from, farther)
}

/// What it costs to hang an organ whose ends these are by its point `p`, metres.
pub(crate) fn middle_cost(p: DVec3, ends: [DVec3; 2]) -> f64 {
    let [from, to] = ends.map(|end| p.distance(end));
    MIDDLE_COST * (ends[0].distance(ends[1]) - from.max(to)).max(0.0)
}

/// About the two points of an organ that are farthest from each other.
pub(crate) fn ends(points: &[DVec3]) -> [DVec3; 2] {
    let end = farthest(points, points.first().copied().unwrap_or_default());
    [end, farthest(points, end)]
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
