//! A cloud at several coarsenesses: the inputs of a network over points (spec/models.md, organ3d).
//!
//! models/training/pyramid.py does the same for training, by the same rule.

use demeter_frame::{ABOVE, LOCAL, NEIGHBOURS, PointPyramid, PyramidLevel};
use glam::DVec3;

use crate::axes::PrincipalAxes;
use crate::cloud::diagonal;
use crate::nearest::{Nearest, in_reach};

/// Edge of the smallest cells of level 1 as a share of the cloud's diagonal: less than half the δ of organ boundaries,
/// beyond which more detail tells organs no better apart (a guess).
const FINEST_SHARE: f64 = 0.004;
/// Factor by which cells grow until few enough are filled: the fourth root of 2.
const GROWTH: f64 = 1.189_207_115_002_721;
/// Most filled cells of level 1. Time on one core is nearly proportional; 4,096 keep a call below 150 ms.
const MOST_CELLS: usize = 4096;
/// Most filled cells of level 3, all of which look at all: time and memory go with the square. More than plants fill,
/// whose surfaces leave most of space empty; clouds of strays fill more.
const MOST_ATTENDING: usize = 512;
/// Spreads below this, in squared cells, count as none.
const LEAST_SPREAD: f64 = 1e-12;

/// Why a cloud has no pyramid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PyramidError {
    /// There is no point.
    #[error("cloud: expected at least 1 point, found none")]
    Empty,
    /// A coordinate is no number that can be squared.
    #[error("cloud: point {index}: expected coordinates within 1e100 metres, found {found}")]
    NotFinite {
        /// The point's index.
        index: usize,
        /// Where it claims to be.
        found: DVec3,
    },
}

/// The pyramid of `points` (metres or any unit, z up); time and memory are linear in their number.
///
/// Level 0 has cubic cells of half the edge of level 1, level 2 of twice and level 3 of four times it (or eight, or more,
/// until at most 512 are filled); a filled cell's point is the mean of the points below that it holds. The cells of level
/// 1 are the smallest that leave at most 4,096 filled, so that neither the number of points nor their density changes what
/// the network sees, but not smaller than
/// 0.4 % of the cloud's diagonal.
///
/// # Errors
/// [`PyramidError`].
pub fn of(points: &[DVec3]) -> Result<PointPyramid, PyramidError> {
    if let Some(index) = points.iter().position(|p| !in_reach(*p)) {
        return Err(PyramidError::NotFinite { index, found: points[index] });
    }
    let low = points.iter().copied().reduce(DVec3::min).ok_or(PyramidError::Empty)?;
    let high = points.iter().copied().fold(low, DVec3::max);
    let size = diagonal(points).filter(|size| *size > 0.0);
    let mut edge = size.unwrap_or(1.0) * FINEST_SHARE;
    let mut keys = keys(points, low, edge);
    while distinct(keys.iter().copied().map(halved)) > MOST_CELLS {
        edge *= GROWTH;
        keys = self::keys(points, low, edge);
    }
    let foot = DVec3::new((low.x + high.x) / 2.0, (low.y + high.y) / 2.0, low.z);
    let all: Vec<DVec3> = points.iter().map(|p| (*p - foot) / edge).collect();

    let zeroth = Cells::of(&keys, &all);
    let first = zeroth.coarser(MOST_CELLS);
    let second = first.coarser(MOST_CELLS);
    let third = second.coarser(MOST_ATTENDING);
    let search = [&zeroth, &first, &second, &third].map(|cells| Nearest::of(&cells.means));
    let level = |cells: &Cells, k: usize, parent: &[i64]| PyramidLevel {
        points: single(&cells.means),
        below: nearest(&search[k - 1], &cells.means),
        beside: nearest(&search[k], &cells.means),
        parent: parent.to_vec(),
    };
    let levels = [level(&first, 1, &second.parent), level(&second, 2, &third.parent), level(&third, 3, &[])];
    let share = size.map_or(0.0, |size| edge / size);
    let local = levels[0].below.iter().map(|near| shape(near.map(|i| zeroth.means[i as usize]), share)).collect();
    Ok(PointPyramid {
        up: nearest::<ABOVE>(&search[1], &all),
        points: single(&all),
        finest: single(&zeroth.means),
        levels,
        local,
    })
}

/// The cell of level 0 that holds each point; level 1 has cells of this `edge`.
fn keys(points: &[DVec3], low: DVec3, edge: f64) -> Vec<[u32; 3]> {
    // At most 2 / 0.4 % = 500 along each axis.
    points.iter().map(|p| ((*p - low) * (2.0 / edge)).to_array().map(|x| x as u32)).collect()
}

fn halved(key: [u32; 3]) -> [u32; 3] {
    key.map(|x| x >> 1)
}

fn distinct(keys: impl Iterator<Item = [u32; 3]>) -> usize {
    let mut cells: Vec<[u32; 3]> = keys.collect();
    cells.sort_unstable();
    cells.dedup();
    cells.len()
}

/// The filled cells of one level, ascending.
struct Cells {
    keys: Vec<[u32; 3]>,
    means: Vec<DVec3>,
    /// For each point below, the cell that holds it.
    parent: Vec<i64>,
}

impl Cells {
    /// `keys` are the cells that hold the points below.
    fn of(keys: &[[u32; 3]], below: &[DVec3]) -> Self {
        let mut order: Vec<usize> = (0..keys.len()).collect();
        order.sort_unstable_by_key(|&i| (keys[i], i));
        let mut cells = Self { keys: Vec::new(), means: Vec::new(), parent: vec![0; keys.len()] };
        for members in order.chunk_by(|&a, &b| keys[a] == keys[b]) {
            members.iter().for_each(|&i| cells.parent[i] = cells.keys.len() as i64);
            cells.keys.push(keys[members[0]]);
            cells.means.push(members.iter().map(|&i| below[i]).sum::<DVec3>() / members.len() as f64);
        }
        cells
    }

    /// The next level: eight cells make one, again and again until at most `most` are filled.
    fn coarser(&self, most: usize) -> Self {
        let mut keys: Vec<[u32; 3]> = self.keys.iter().copied().map(halved).collect();
        while distinct(keys.iter().copied()) > most {
            keys.iter_mut().for_each(|key| *key = halved(*key));
        }
        Self::of(&keys, &self.means)
    }
}

fn single(points: &[DVec3]) -> Vec<[f32; 3]> {
    points.iter().map(|p| p.as_vec3().to_array()).collect()
}

/// The `K` nearest of each query, nearest first; the farthest again where there are fewer.
fn nearest<const K: usize>(search: &Nearest, queries: &[DVec3]) -> Vec<[i64; K]> {
    let one = |query: &DVec3| {
        let found = search.k(*query, K);
        std::array::from_fn(|k| found.get(k).or(found.last()).map_or(0, |n| n.index as i64))
    };
    queries.iter().map(one).collect()
}

/// Linearity, planarity and scattering (Demantké et al. 2011, of variances), sizes of the vertical parts of the normal
/// and of the main axis; and the edge's `share` of the diagonal.
fn shape(group: [DVec3; NEIGHBOURS], share: f64) -> [f32; LOCAL] {
    let axes = PrincipalAxes::of(group.into_iter());
    let [long, wide, thick] = axes.deviation.map(|deviation| deviation * deviation);
    let most = long.max(LEAST_SPREAD);
    let (main, normal) = (axes.axes.x_axis, axes.axes.z_axis);
    [(long - wide) / most, (wide - thick) / most, thick / most, normal.z.abs(), main.z.abs(), share].map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cloud() -> impl Strategy<Value = Vec<DVec3>> {
        prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array), 1..300)
    }

    fn place(p: [f32; 3]) -> DVec3 {
        glam::Vec3::from_array(p).as_dvec3()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_index_is_of_its_level_and_levels_shrink(points in cloud()) {
            let made = of(&points).unwrap();
            let [first, second, third] = &made.levels;
            let sizes = [&made.finest, &first.points, &second.points, &third.points].map(Vec::len);
            prop_assert!(points.len() >= sizes[0] && sizes.is_sorted_by(|a, b| a >= b) && sizes[3] > 0);
            prop_assert_eq!((made.points.len(), made.up.len(), made.local.len()), (points.len(), points.len(), sizes[1]));
            let inside = |indices: &[i64], level: usize| indices.iter().all(|i| (0..sizes[level] as i64).contains(i));
            prop_assert!(inside(made.up.as_flattened(), 1));
            for (level, k) in made.levels.iter().zip(1..) {
                prop_assert_eq!((level.below.len(), level.beside.len()), (sizes[k], sizes[k]));
                prop_assert!(inside(level.below.as_flattened(), k - 1) && inside(level.beside.as_flattened(), k));
                prop_assert!(inside(&level.parent, (k + 1).min(3)));
                prop_assert_eq!(level.parent.len(), if k < 3 { sizes[k] } else { 0 });
                prop_assert!(level.beside.iter().enumerate().all(|(i, near)| near[0] == i as i64));
            }
        }

        #[test]
        fn neighbours_come_nearest_first_and_none_nearer_is_missing(points in cloud()) {
            let made = of(&points).unwrap();
            let first = &made.levels[0].points;
            for (p, near) in made.points.iter().zip(&made.up) {
                let mut all: Vec<f64> = first.iter().map(|q| place(*p).distance(place(*q))).collect();
                all.sort_unstable_by(f64::total_cmp);
                for (k, i) in near.iter().enumerate() {
                    // Single precision of coordinates up to some hundred cells.
                    let expected = all[k.min(all.len() - 1)];
                    prop_assert!((place(*p).distance(place(first[*i as usize])) - expected).abs() < 1e-3);
                }
            }
        }

        /// Multiples of two and of a cell leave nothing to rounding.
        #[test]
        fn size_and_place_do_not_matter(points in cloud()) {
            let doubled: Vec<DVec3> = points.iter().map(|p| *p * 4.0).collect();
            prop_assert_eq!(of(&points), of(&doubled));
        }

        #[test]
        fn parents_are_means_of_their_children(points in cloud()) {
            let made = of(&points).unwrap();
            for pair in made.levels.windows(2) {
                for (k, mean) in pair[1].points.iter().enumerate() {
                    let children = pair[0].points.iter().zip(&pair[0].parent).filter(|(_, parent)| **parent == k as i64);
                    let children: Vec<DVec3> = children.map(|(p, _)| place(*p)).collect();
                    let expected = children.iter().copied().sum::<DVec3>() / children.len() as f64;
                    prop_assert!(place(*mean).distance(expected) < 1e-3);
                }
            }
        }
    }

    #[test]
    fn however_many_points_there_are_levels_stay_small() {
        let side = 300;
        let sheet: Vec<DVec3> = (0..side * side)
            .map(|i| DVec3::new(f64::from(i % side), f64::from(i / side), 0.0) / f64::from(side))
            .collect();
        let made = of(&sheet).unwrap();
        let first = &made.levels[0].points;
        assert!((MOST_CELLS / 2..=MOST_CELLS).contains(&first.len()), "{}", first.len());
        assert!(made.finest.len() <= 8 * MOST_CELLS && made.points.len() == sheet.len());
        // A level sheet is planar with a vertical normal.
        let flat = made.local.iter().filter(|local| local[1] > 0.5 && local[2] < 1e-6 && local[3] > 0.999);
        assert!(flat.count() * 10 > first.len() * 8);
    }

    #[test]
    fn strays_all_over_space_do_not_swell_the_level_that_attends() {
        let strays: Vec<DVec3> = (0..20_000)
            .map(|i| DVec3::new(0.618_033, 0.754_877, 0.569_84).map(|k| (f64::from(i) * k).fract()))
            .collect();
        let made = of(&strays).unwrap();
        assert!(made.levels[0].points.len() > MOST_CELLS / 8);
        assert!((MOST_ATTENDING / 16..=MOST_ATTENDING).contains(&made.levels[2].points.len()));
    }

    #[test]
    fn upright_line_is_linear_and_vertical() {
        let line: Vec<DVec3> = (0..500).map(|i| DVec3::Z * f64::from(i)).collect();
        let made = of(&line).unwrap();
        assert!(made.local.iter().all(|local| local[0] > 0.999 && local[4] > 0.999));
        assert!(made.points.iter().all(|p| p[2] >= 0.0));
    }

    #[test]
    fn one_point_and_coinciding_points_have_a_pyramid_and_what_is_none_has_not() {
        for points in [vec![DVec3::ONE], vec![DVec3::ONE; 1000]] {
            let made = of(&points).unwrap();
            assert_eq!((made.points.len(), made.finest.len(), made.levels[2].points.len()), (points.len(), 1, 1));
            assert!(made.local.as_flattened().iter().all(|x| x.is_finite()));
        }
        assert_eq!(of(&[]), Err(PyramidError::Empty));
        for bad in [DVec3::NAN, DVec3::splat(f64::MAX), DVec3::new(0.0, f64::INFINITY, 0.0)] {
            assert!(matches!(of(&[DVec3::ZERO, bad]), Err(PyramidError::NotFinite { index: 1, .. })), "{bad}");
        }
        let wide = [DVec3::splat(-1e99), DVec3::splat(1e99), DVec3::ZERO];
        assert!(of(&wide).unwrap().points.as_flattened().iter().all(|x| x.is_finite()));
    }
}
