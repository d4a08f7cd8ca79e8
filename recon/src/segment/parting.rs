//! Blades that hang together without a neck between them taken apart where the leaf model says so: what is one blade to
//! the eye of geometry, and a bad one to the model, is several if several fit far better.

use glam::DVec3;

use super::MIN_ORGAN_POINTS;
use super::lattice::one_a_cell;
use crate::cloud::diagonal;
use crate::fit::lone_blade;
use crate::graph::CloudGraph;
use crate::metrics::rough_chamfer;
use crate::model::{Detail, Knots, PlantMesh, Species};
use crate::nearest::Nearest;
use crate::statistics::median;

/// Points of one blade that judge it.
const SEEN: usize = 300;
/// Samples of a surface that judge it.
const SAMPLES: usize = 300;
/// A blade that misses its points by less than this many times what the plant's blades do is not doubted (a guess).
const DOUBT: f64 = 1.25;
/// Largest share of its miss that parts of a blade may leave (a guess: each part has its own ten shapes and bends, and
/// halves of one blade gain little by them).
const LEFT: f64 = 0.4;
/// Most parts tried at once: leaflets of one leaf meet in one place.
const PARTS: usize = 3;

/// Takes each doubtful blade apart for as long as that pays.
pub(super) fn part(points: &[DVec3], blades: Vec<Vec<usize>>, up: DVec3, species: &Species) -> Vec<Vec<usize>> {
    let judged: Vec<Judged> = blades.into_iter().map(|blade| Judged::of(points, blade, up, species)).collect();
    let usual = median(judged.iter().map(|blade| blade.miss)).unwrap_or(0.0);
    let (mut open, mut done) = (judged, Vec::new());
    while let Some(blade) = open.pop() {
        let parts = (blade.miss > DOUBT * usual).then(|| blade.best_parts(points, up, species)).flatten();
        match parts {
            Some(parts) => open.extend(parts),
            None => done.push(blade.members),
        }
    }
    done.sort();
    done
}

/// A blade with how far its points and its fitted surface are from each other.
struct Judged {
    members: Vec<usize>,
    /// Metres; 0 of what cannot be fitted, which nothing can better.
    miss: f64,
}

impl Judged {
    fn of(points: &[DVec3], members: Vec<usize>, up: DVec3, species: &Species) -> Self {
        let seen = few(&members.iter().map(|i| points[*i]).collect::<Vec<_>>());
        let miss = lone_blade(&seen, None, up, species).ok().and_then(|fitted| {
            let mesh = PlantMesh::of(&fitted.posed(species), Detail::Control, Knots::Uniform);
            Some(rough_chamfer(&seen, &mesh, SAMPLES)?.cd * diagonal(&seen)?)
        });
        Self { members, miss: miss.unwrap_or(0.0) }
    }

    /// The division that pays; one into more parts must pay beside the one into fewer.
    fn best_parts(&self, points: &[DVec3], up: DVec3, species: &Species) -> Option<Vec<Self>> {
        let (mut best, mut least) = (None, self.miss * self.members.len() as f64);
        for parts in self.divisions(points) {
            let parts: Vec<Self> = parts.into_iter().map(|part| Self::of(points, part, up, species)).collect();
            let miss = parts.iter().map(|part| part.miss * part.members.len() as f64).sum();
            if miss < LEFT * least {
                (best, least) = (Some(parts), miss);
            }
        }
        best
    }

    /// Divisions into 2 to [`PARTS`]: the points by which of so many tips, as far from each other along the blade as can
    /// be, is nearest along it.
    fn divisions(&self, points: &[DVec3]) -> Vec<Vec<Vec<usize>>> {
        let own: Vec<DVec3> = self.members.iter().map(|i| points[*i]).collect();
        let few = few(&own);
        let graph = CloudGraph::new(&few);
        let search = Nearest::of(&few);
        let place: Vec<usize> = own.iter().map(|p| search.one(*p).map_or(0, |n| n.index)).collect();
        let farthest = |from: &[f64]| (0..from.len()).max_by(|a, b| from[*a].total_cmp(&from[*b])).unwrap_or(0);
        // The ways from each tip, and from the nearest of them.
        let mut along = vec![graph.distances(&[farthest(&graph.distances(&[0]))])];
        let mut nearest = along[0].clone();
        let mut divisions = Vec::new();
        for count in 2..=PARTS {
            let ways = graph.distances(&[farthest(&nearest)]);
            nearest.iter_mut().zip(&ways).for_each(|(near, way)| *near = near.min(*way));
            along.push(ways);
            let tip = |n: usize| (0..count).min_by(|a, b| along[*a][n].total_cmp(&along[*b][n])).unwrap_or(0);
            let mut parts = vec![Vec::new(); count];
            self.members.iter().zip(&place).for_each(|(i, n)| parts[tip(*n)].push(*i));
            if parts.iter().all(|part| part.len() >= MIN_ORGAN_POINTS) {
                divisions.push(parts);
            }
        }
        divisions
    }
}

/// At most about [`SEEN`] of the points.
fn few(points: &[DVec3]) -> Vec<DVec3> {
    one_a_cell(points, SEEN).into_iter().map(|i| points[i]).collect()
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat};

    use super::*;
    use crate::species::generic;

    /// An oval blade 6 cm long from the origin, turned about the vertical and bent down along its length; 1 mm of noise.
    fn oval(azimuth: f64, bend: f64) -> Vec<DVec3> {
        let turn = DMat3::from_rotation_z(azimuth);
        let spread = |i: usize, base: f64| (i as f64 * base).fract();
        let inside = (0..400).map(|i| (spread(i, 0.754_877_666), 2.0 * spread(i, 0.569_840_291) - 1.0));
        let on_blade = inside.filter(|(u, v)| v.abs() < (4.0 * u * (1.0 - u)).sqrt() && *u > 0.02);
        let place = |(k, (u, v)): (usize, (f64, f64))| {
            let along = DQuat::from_rotation_y(bend * u) * DVec3::new(0.06 * u, 0.018 * v, 0.0);
            turn * (along + DVec3::Z * 0.001 * (2.0 * spread(k, 0.618_033_989) - 1.0))
        };
        on_blade.enumerate().map(place).collect()
    }

    fn parts(blades: &[Vec<DVec3>]) -> Vec<usize> {
        let points = blades.concat();
        // A plant of such blades: nothing is doubted without better ones beside it.
        let others: Vec<Vec<DVec3>> = (0..3)
            .map(|k| oval(0.0, 0.2).iter().map(|p| *p + DVec3::Z * (0.2 + 0.1 * f64::from(k))).collect())
            .collect();
        let mut all = points.clone();
        let mut members = vec![(0..points.len()).collect::<Vec<_>>()];
        for other in others {
            members.push((all.len()..all.len() + other.len()).collect());
            all.extend(other);
        }
        let found = part(&all, members, DVec3::Z, &generic("soybean").unwrap().unwrap());
        found.iter().filter(|blade| blade[0] < points.len()).map(Vec::len).collect()
    }

    #[test]
    fn leaflets_that_meet_are_parted() {
        let leaflets: Vec<Vec<DVec3>> = [-1.6, 0.0, 1.6].map(|azimuth| oval(azimuth, 0.5)).to_vec();
        let found = parts(&leaflets);
        assert_eq!(found.len(), 3, "{found:?}");
        // Nearly all of each leaflet stays together.
        let each = leaflets[0].len() as f64;
        assert!(found.iter().all(|n| (*n as f64 / each - 1.0).abs() < 0.1), "{found:?} of {each} each");
    }

    #[test]
    fn a_blade_stays_whole_however_it_bends() {
        for bend in [0.0, 0.6, 1.2] {
            assert_eq!(parts(&[oval(0.7, bend)]).len(), 1, "bent by {bend}");
        }
    }
}
