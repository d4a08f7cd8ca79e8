//! How well a cloud was divided into organs (spec/reconstruction.md "Metrics"): instances matched at an overlap of one
//! half, their mean coverage, points of the right class. An instance is one blade, also where several are leaflets of
//! one leaf, or one stem; petioles and rachises are stems. So the labels of the scans have it.

use std::collections::{BTreeMap, BTreeSet};

use crate::cloud::PointOrgan;
use crate::model::OrganKind;

/// Least intersection over union of a found instance with a true one that is the same.
const SAME: f64 = 0.5;
/// A true organ of fewer points is none to a scan: buds, and what occlusion left of others. Nobody is asked for its
/// points.
pub const MIN_SEEN_POINTS: usize = 12;

/// Counts over one or more clouds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Division {
    /// Instances that were found.
    pub found: usize,
    /// True instances.
    pub truth: usize,
    /// True instances that were found.
    pub matched: usize,
    /// Sum over the true instances of the best overlap of any found one with each.
    coverage: f64,
    /// Points of the class in truth and result, and in either; stems, then leaves.
    shared: [usize; 2],
    either: [usize; 2],
    /// Stem points, and those of them that are rightly the main stem's or others'.
    stem_points: usize,
    right_stem_points: usize,
}

/// An instance: whether it is a leaf, and its number.
type Id = (bool, i32);

fn id(point: &PointOrgan) -> Option<Id> {
    (point.organ >= 0).then_some((point.kind == OrganKind::Leaf, point.organ))
}

impl Division {
    /// Compares what was found with the truth, point by point; negative organs are none. Points that the truth gives to
    /// no organ of [`MIN_SEEN_POINTS`] do not count.
    #[must_use]
    pub fn of(found: &[PointOrgan], truth: &[PointOrgan]) -> Self {
        let mut true_size: BTreeMap<Id, usize> = BTreeMap::new();
        truth.iter().filter_map(id).for_each(|id| *true_size.entry(id).or_default() += 1);
        true_size.retain(|_, size| *size >= MIN_SEEN_POINTS);
        let seen = |(_, truth): &(&PointOrgan, &PointOrgan)| id(truth).is_some_and(|id| true_size.contains_key(&id));
        let mut sums = Self { truth: true_size.len(), ..Self::default() };
        let mut found_size: BTreeMap<Id, usize> = BTreeMap::new();
        let mut common: BTreeMap<(Id, Id), usize> = BTreeMap::new();
        for (found, truth) in found.iter().zip(truth).filter(seen) {
            sums.count_classes(found, truth);
            let (Some(found), Some(truth)) = (id(found), id(truth)) else { continue };
            *found_size.entry(found).or_default() += 1;
            *common.entry((truth, found)).or_default() += 1;
        }
        sums.found = found_size.len();
        let overlap = |((truth, found), common): (&(Id, Id), &usize)| {
            (*common as f64 / (true_size[truth] + found_size[found] - common) as f64, *truth, *found)
        };
        // Only like is compared with like.
        let mut overlaps: Vec<(f64, Id, Id)> =
            common.iter().filter(|((truth, found), _)| truth.0 == found.0).map(overlap).collect();
        overlaps.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (mut covered, mut taken) = (BTreeSet::new(), BTreeSet::new());
        for (overlap, truth, found) in overlaps {
            let first = covered.insert(truth);
            sums.coverage += if first { overlap } else { 0.0 };
            // At an overlap above one half nobody else can have either; at one half exactly the first has them.
            if overlap >= SAME && first && taken.insert(found) {
                sums.matched += 1;
            }
        }
        sums
    }

    fn count_classes(&mut self, found: &PointOrgan, truth: &PointOrgan) {
        let class = |point: &PointOrgan| id(point).map(|(leaf, _)| usize::from(leaf));
        let (f, t) = (class(found), class(truth));
        for class in 0..2 {
            self.shared[class] += usize::from(f == Some(class) && t == Some(class));
            self.either[class] += usize::from(f == Some(class) || t == Some(class));
        }
        if t == Some(0) {
            self.stem_points += 1;
            self.right_stem_points += usize::from(f == t && found.kind == truth.kind);
        }
    }

    /// Adds the counts of other clouds.
    pub fn add(&mut self, other: &Self) {
        self.found += other.found;
        self.truth += other.truth;
        self.matched += other.matched;
        self.coverage += other.coverage;
        for class in 0..2 {
            self.shared[class] += other.shared[class];
            self.either[class] += other.either[class];
        }
        self.stem_points += other.stem_points;
        self.right_stem_points += other.right_stem_points;
    }

    /// Share of the found instances that are true ones; `None` when nothing was found.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        ratio(self.matched as f64, self.found)
    }

    /// Share of the true instances that were found; `None` without any.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        ratio(self.matched as f64, self.truth)
    }

    /// Mean over the true instances of the best overlap of a found one of the same class; `None` without any.
    #[must_use]
    pub fn coverage(&self) -> Option<f64> {
        ratio(self.coverage, self.truth)
    }

    /// Mean of the classes' intersections over unions, stem and leaf, over points; a class that neither truth nor
    /// result has is left out, `None` when that is both.
    #[must_use]
    pub fn semantic_iou(&self) -> Option<f64> {
        crate::statistics::mean((0..2).filter_map(|class| ratio(self.shared[class] as f64, self.either[class])))
    }

    /// Share of the true stem points that are rightly the main stem's or another stem's; `None` without any.
    #[must_use]
    pub fn right_stems(&self) -> Option<f64> {
        ratio(self.right_stem_points as f64, self.stem_points)
    }
}

fn ratio(part: f64, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part / whole as f64)
}

/// The same points with all stems as one instance, as labels have them that tell no stems apart.
#[must_use]
pub fn stems_merged(points: &[PointOrgan]) -> Vec<PointOrgan> {
    let merged = |point: &PointOrgan| match point.kind {
        OrganKind::Leaf => *point,
        OrganKind::MainStem | OrganKind::Stem => PointOrgan { organ: point.organ.min(0), kind: OrganKind::MainStem },
    };
    points.iter().map(merged).collect()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    use super::*;

    fn organ(number: i32, kind: OrganKind) -> PointOrgan {
        PointOrgan { organ: number, kind }
    }

    /// Runs of points of one organ each; organ 0 is the main stem, 1 another stem, the rest are leaves, negative none.
    fn cloud(runs: &[(i32, usize)]) -> Vec<PointOrgan> {
        let kind = |number: i32| match number {
            0 => OrganKind::MainStem,
            1 => OrganKind::Stem,
            _ => OrganKind::Leaf,
        };
        runs.iter().flat_map(|(number, n)| vec![organ(*number, kind(*number)); *n]).collect()
    }

    #[test]
    fn a_worked_example() {
        let truth = cloud(&[(0, 60), (1, 40), (2, 100), (3, 100), (4, 100), (5, MIN_SEEN_POINTS - 1)]);
        // Part of the petiole goes to the main stem and part to a leaf, leaf 3 is in halves, leaf 4 is not found.
        let found = cloud(&[(0, 90), (2, 110), (6, 50), (7, 50), (-1, 100), (8, MIN_SEEN_POINTS - 1)]);
        let division = Division::of(&found, &truth);
        assert_eq!((division.found, division.truth, division.matched), (4, 5, 3));
        assert_relative_eq!(division.coverage().unwrap(), (60.0 / 90.0 + 30.0 / 100.0 + 100.0 / 110.0 + 0.5) / 5.0);
        assert_relative_eq!(division.semantic_iou().unwrap(), (90.0 / 100.0 + 200.0 / 310.0) / 2.0);
        assert_relative_eq!(division.right_stems().unwrap(), 0.6);
        let merged = Division::of(&stems_merged(&found), &stems_merged(&truth));
        assert_eq!((merged.found, merged.truth, merged.matched), (4, 4, 3));
        assert_eq!(merged.right_stems(), Some(0.9));
        let nothing = Division::of(&[], &[]);
        assert_eq!((nothing.precision(), nothing.coverage(), nothing.semantic_iou()), (None, None, None));
    }

    /// Points of a few organs each, in truth and result.
    fn pairs() -> impl Strategy<Value = Vec<(i32, i32)>> {
        prop::collection::vec((-1..6, -1..6), 0..300)
    }

    fn both(pairs: &[(i32, i32)]) -> (Vec<PointOrgan>, Vec<PointOrgan>) {
        let of = |number: i32| cloud(&[(number, 1)])[0];
        pairs.iter().map(|(found, truth)| (of(*found), of(*truth))).unzip()
    }

    proptest! {
        #[test]
        fn the_truth_is_right_by_itself(pairs in pairs()) {
            let (truth, _) = both(&pairs);
            let division = Division::of(&truth, &truth);
            prop_assert_eq!((division.found, division.matched), (division.truth, division.truth));
            prop_assert!(division.coverage().is_none_or(|share| share == 1.0));
            prop_assert!(division.semantic_iou().is_none_or(|share| share == 1.0));
            prop_assert!(division.right_stems().is_none_or(|share| share == 1.0));
        }

        #[test]
        fn numbers_and_order_do_not_matter(pairs in pairs(), shift in 1..9_i32) {
            let (found, truth) = both(&pairs);
            let expected = Division::of(&found, &truth);
            let renumbered: Vec<PointOrgan> =
                found.iter().map(|p| organ(if p.organ < 0 { -1 } else { shift + 7 * p.organ }, p.kind)).collect();
            let (mut found, mut truth) = (renumbered, truth);
            found.reverse();
            truth.reverse();
            let division = Division::of(&found, &truth);
            prop_assert_eq!((division.found, division.truth, division.matched), (expected.found, expected.truth, expected.matched));
            prop_assert!((division.coverage - expected.coverage).abs() < 1e-9);
        }

        #[test]
        fn shares_are_shares_and_sums_are_of_all(pairs in pairs(), more in pairs()) {
            let (found, truth) = both(&pairs);
            let mut division = Division::of(&found, &truth);
            prop_assert!(division.matched <= division.found.min(division.truth));
            // A match of one half at least covers as much.
            prop_assert!(division.coverage >= SAME * division.matched as f64 - 1e-9);
            let (found, truth) = both(&more);
            division.add(&Division::of(&found, &truth));
            for share in [division.precision(), division.recall(), division.coverage(), division.semantic_iou(), division.right_stems()] {
                prop_assert!(share.is_none_or(|share| (0.0..=1.0).contains(&share)));
            }
        }
    }
}
