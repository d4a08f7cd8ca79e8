//! Nearest neighbours: the one k-d tree of the crate.

use std::num::NonZero;

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Coordinates beyond this many metres are treated as not finite, so that squared distances cannot overflow.
const FARTHEST_METRES: f64 = 1e100;

/// A point that a query found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Index into the points that the search was built from.
    pub index: usize,
    /// Squared distance from the query, square metres.
    pub distance_squared: f64,
}

impl Neighbour {
    /// Distance from the query in metres.
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.distance_squared.sqrt()
    }
}

/// A search structure over points that do not move. Any number of points will do, also none, and also points that
/// coincide; points that are not finite are never found.
#[derive(Debug)]
pub struct Nearest {
    /// Immutable, because kiddo's mutable tree refuses more than a bucket of points that share a coordinate, as flat
    /// clouds do; this one lets such buckets grow.
    tree: ImmutableKdTree<f64, 3>,
}

impl Nearest {
    /// Builds the search; O(n log n).
    ///
    /// # Panics
    /// Never: the tree's only errors are those of generated items and of mutable buckets, and this one has neither.
    /// More than `u32::MAX` points would not fit in memory.
    #[must_use]
    pub fn of(points: &[DVec3]) -> Self {
        let entries: Vec<(u32, [f64; 3])> =
            (0..).zip(points).filter(|(_, p)| in_reach(**p)).map(|(i, p)| (i, p.to_array())).collect();
        Self { tree: ImmutableKdTree::new_from_entries(&entries).expect("an immutable tree takes any finite points") }
    }

    /// How many points can be found.
    #[must_use]
    pub fn len(&self) -> usize {
        self.tree.size()
    }

    /// True when no point can be found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The nearest point, `None` when there is none or the query is not finite; of points that are equally far, the
    /// same one every time.
    #[must_use]
    pub fn one(&self, query: DVec3) -> Option<Neighbour> {
        if self.is_empty() || !in_reach(query) {
            return None;
        }
        let found = self.tree.query(&query.to_array()).nearest_one::<SquaredEuclidean<f64>>().execute();
        Some(Neighbour { index: found.item as usize, distance_squared: found.distance })
    }

    /// The `k` nearest points, nearest first, then by index; fewer when there are fewer.
    #[must_use]
    pub fn k(&self, query: DVec3, k: usize) -> Vec<Neighbour> {
        // The tree reserves room for k results, so k is cut to what there is.
        let Some(k) = NonZero::new(k.min(self.len())).filter(|_| in_reach(query)) else { return Vec::new() };
        let found = self.tree.query(&query.to_array()).nearest_n::<SquaredEuclidean<f64>>(k).execute();
        sorted(found.into_iter().map(|n| Neighbour { index: n.item as usize, distance_squared: n.distance }))
    }

    /// All points within `radius` metres (boundary included), nearest first, then by index.
    #[must_use]
    pub fn within(&self, query: DVec3, radius: f64) -> Vec<Neighbour> {
        if self.is_empty() || !in_reach(query) || !(0.0..=FARTHEST_METRES).contains(&radius) {
            return Vec::new();
        }
        let squared = radius * radius;
        let query = query.to_array();
        let found = self.tree.query(&query).within::<SquaredEuclidean<f64>>(squared).unsorted().execute();
        sorted(found.into_iter().map(|n| Neighbour { index: n.item as usize, distance_squared: n.distance }))
    }
}

pub(crate) fn in_reach(p: DVec3) -> bool {
    p.abs().max_element() < FARTHEST_METRES && !p.is_nan()
}

fn sorted(found: impl Iterator<Item = Neighbour>) -> Vec<Neighbour> {
    let mut found: Vec<Neighbour> = found.collect();
    found
        .sort_unstable_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared).then_with(|| a.index.cmp(&b.index)));
    found
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Coordinates on a coarse lattice, so that many coincide on an axis or altogether.
    fn lattice() -> impl Strategy<Value = DVec3> {
        (0..4_i32, 0..2_i32, 0..9_i32).prop_map(|(x, y, z)| DVec3::new(x.into(), y.into(), z.into()) * 0.1)
    }

    proptest! {
        #[test]
        fn finds_what_looking_at_every_point_finds(
            points in prop::collection::vec(lattice(), 0..300),
            query in lattice(),
            k in 0..40_usize,
            radius in 0.0..0.5_f64,
        ) {
            let search = Nearest::of(&points);
            let all = sorted(points.iter().enumerate().map(|(index, p)| {
                Neighbour { index, distance_squared: p.distance_squared(query) }
            }));
            prop_assert_eq!(search.one(query).map(|n| n.distance_squared), all.first().map(|n| n.distance_squared));
            let nearest = search.k(query, k);
            prop_assert_eq!(nearest.len(), k.min(points.len()));
            for (found, expected) in nearest.iter().zip(&all) {
                prop_assert_eq!(found.distance_squared, expected.distance_squared);
                prop_assert_eq!(found.distance_squared, points[found.index].distance_squared(query));
            }
            let inside: Vec<Neighbour> =
                all.into_iter().filter(|n| n.distance_squared <= radius * radius).collect();
            prop_assert_eq!(search.within(query, radius), inside);
        }
    }

    #[test]
    fn coinciding_flat_and_absurd_points_are_no_trouble() {
        let same = Nearest::of(&[DVec3::ONE; 1000]);
        assert_eq!(same.k(DVec3::ZERO, 2000).len(), 1000);
        assert_eq!(same.within(DVec3::ONE, 0.0).len(), 1000);
        let flat: Vec<DVec3> = (0..20_000).map(|i| DVec3::new(f64::from(i % 100), f64::from(i / 100), 0.0)).collect();
        assert_eq!(Nearest::of(&flat).one(DVec3::new(42.1, 17.2, 3.0)).map(|n| n.index), Some(1742));
        let absurd = Nearest::of(&[DVec3::NAN, DVec3::splat(f64::MAX), DVec3::X, DVec3::INFINITY]);
        assert_eq!((absurd.len(), absurd.one(DVec3::ZERO).map(|n| n.index)), (1, Some(2)));
        assert_eq!(absurd.one(DVec3::new(0.0, f64::NAN, 0.0)), None);
        assert!(absurd.within(DVec3::ZERO, f64::NAN).is_empty() && absurd.k(DVec3::NAN, 3).is_empty());
        let none = Nearest::of(&[]);
        assert!(none.is_empty() && none.one(DVec3::ZERO).is_none() && none.k(DVec3::ZERO, 3).is_empty());
    }
}
