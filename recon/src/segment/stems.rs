//! Stems under one label taken apart: the main stem, branches, and each leaf's petiole, along their skeleton.

use glam::DVec3;

use super::beside::Track;
use super::lattice::one_a_cell;
use super::{grain, nearest_to, organ};
use crate::graph::{CloudGraph, Skeleton};
use crate::model::{Habit, OrganKind};
use crate::nearest::Nearest;
use crate::organs::OrganCloud;
use crate::statistics::mean;
use crate::tree::middle_cost;

/// Points of all stems together that the skeleton is drawn from: more than a scan's stems have, few enough to be quick.
const SEEN: usize = 6_000;
/// Points of a blade that say where it hangs.
const BLADE_SEEN: usize = 300;
/// Thickness of a level of the skeleton in grains: each holds a ring of points.
const LEVEL: f64 = 2.0;
/// Shortest side branch in grains beyond its parent's thickness; what is shorter is a bump of it.
const LEAST: f64 = 4.0;
/// A side branch without leaves must be longer by this factor.
const BARE: f64 = 3.0;
/// Levels over which directions are compared at a fork.
const AHEAD: usize = 6;
/// Cosine of the largest turn of a stem that goes on beyond its last fork (20°): petioles leave more sharply.
const STRAIGHT: f64 = 0.94;

/// Divides the stem points `members`; `blades` say what hangs on them. The main stem comes first: where `main` has for
/// each of the points a chance that it is the main stem's and no other stem's, the way that agrees best with those, else
/// the one that carries most.
pub(super) fn split(
    points: &[DVec3],
    members: &[usize],
    blades: &[Vec<usize>],
    foot: DVec3,
    habit: Habit,
    main: Option<&[f64]>,
) -> Vec<OrganCloud> {
    let all: Vec<DVec3> = members.iter().map(|i| points[*i]).collect();
    let seen = one_a_cell(&all, SEEN);
    let own: Vec<DVec3> = seen.iter().map(|i| all[*i]).collect();
    let search = Nearest::of(&own);
    // The third neighbour, because stems of sparse scans are single rows of points.
    let grain = grain(&own, &search, 3);
    let graph = CloudGraph::new(&own);
    let skeleton = Skeleton::of(&own, &graph, nearest_to(&own, foot), LEVEL * grain);
    let mut node_of = vec![0; own.len()];
    for (k, set) in skeleton.sets.iter().enumerate() {
        set.iter().for_each(|i| node_of[*i] = k);
    }
    let hangs: Vec<(usize, f64)> = blades
        .iter()
        .filter_map(|blade| {
            let blade: Vec<DVec3> =
                blade.iter().step_by(blade.len().div_ceil(BLADE_SEEN)).map(|i| points[*i]).collect();
            let (at, size) = joint(&blade, &search)?;
            Some((node_of[at], size))
        })
        .collect();
    let main = main.map(|chance| {
        let of_set = |set: &Vec<usize>| mean(set.iter().map(|i| chance[members[seen[*i]]])).unwrap_or(0.0);
        skeleton.sets.iter().map(of_set).collect()
    });
    let division = Division::of(&own, skeleton, &hangs, LEAST * grain, habit, main);
    let mut owner: Vec<usize> = node_of.iter().map(|node| division.organ_of[*node]).collect();
    for track in division.tracks() {
        track.follow(&own, &search, grain, |i| &division.skeleton.sets[node_of[i]], &mut owner);
    }
    let mut divided = vec![Vec::new(); division.organs];
    for (p, i) in all.iter().zip(members) {
        divided[search.one(*p).map_or(0, |n| owner[n.index])].push(*i);
    }
    let kind = |k: usize| if k == 0 { OrganKind::MainStem } else { OrganKind::Stem };
    divided.into_iter().enumerate().map(|(k, members)| organ(points, kind(k), members)).collect()
}

/// The stem point at which a blade hangs, and the blade's length.
fn joint(blade: &[DVec3], stems: &Nearest) -> Option<(usize, f64)> {
    let ends = crate::tree::ends(blade);
    let cost = |p: &DVec3| {
        let found = stems.one(*p)?;
        Some((found.distance() + middle_cost(*p, ends), found.index))
    };
    let best = blade.iter().filter_map(cost).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, at)| (at, ends[0].distance(ends[1])))
}

/// A skeleton's nodes given to organs.
struct Division {
    skeleton: Skeleton,
    children: Vec<Vec<usize>>,
    /// Leaves at and beyond each node.
    leaves: Vec<usize>,
    /// Side stems at and beyond each node, petiolules left out.
    sides: Vec<usize>,
    /// Length of the longest path beyond each node, metres.
    beyond: Vec<f64>,
    /// Mean distance of each node's points from its centre, metres.
    radius: Vec<f64>,
    /// Length of a side branch beyond its parent's thickness, metres.
    least: f64,
    organ_of: Vec<usize>,
    organs: usize,
    /// What the way to each node and on gains by being the main stem's: metres that are likelier so than not, less the
    /// others. 0 everywhere when nothing is known.
    main: Vec<f64>,
}

impl Division {
    fn of(
        points: &[DVec3],
        skeleton: Skeleton,
        hangs: &[(usize, f64)],
        least: f64,
        habit: Habit,
        main: Option<Vec<f64>>,
    ) -> Self {
        let n = skeleton.sets.len();
        let mut children = vec![Vec::new(); n];
        for (k, parent) in skeleton.parent.iter().enumerate() {
            parent.iter().for_each(|p| children[*p].push(k));
        }
        let radius = (0..n)
            .map(|k| {
                let set = &skeleton.sets[k];
                set.iter().map(|i| points[*i].distance(skeleton.centres[k])).sum::<f64>() / set.len() as f64
            })
            .collect();
        let mut division = Self {
            children,
            leaves: vec![0; n],
            sides: vec![0; n],
            beyond: vec![0.0; n],
            radius,
            least,
            organ_of: vec![0; n],
            organs: 1,
            main: vec![0.0; n],
            skeleton,
        };
        division.count_leaves(hangs, habit);
        division.count_sides();
        division.follow_main(main);
        division.walk();
        division
    }

    /// Counts leaves from the tips down; blades whose ways part only shortly before them are leaflets of one leaf.
    fn count_leaves(&mut self, hangs: &[(usize, f64)], habit: Habit) {
        let n = self.leaves.len();
        let mut blades: Vec<usize> = vec![0; n];
        let mut length = vec![0.0_f64; n];
        // Length of the longest way from each node to a blade.
        let mut way = vec![0.0_f64; n];
        for (node, size) in hangs {
            blades[*node] += 1;
            self.leaves[*node] += 1;
            length[*node] = length[*node].max(*size);
        }
        for k in (0..n).rev() {
            if blades[k] > 1 && habit.shares_a_petiole(blades[k]) && habit.is_petiolule(way[k], length[k]) {
                self.leaves[k] = 1;
            }
            let Some(p) = self.skeleton.parent[k] else { continue };
            let step = self.skeleton.centres[k].distance(self.skeleton.centres[p]);
            self.beyond[p] = self.beyond[p].max(self.beyond[k] + step);
            blades[p] += blades[k];
            self.leaves[p] += self.leaves[k];
            if blades[k] > 0 {
                way[p] = way[p].max(way[k] + step);
                length[p] = length[p].max(length[k]);
            }
        }
    }

    fn count_sides(&mut self) {
        for k in (0..self.sides.len()).rev() {
            if self.leaves[k] > 1 {
                self.sides[k] += self.branches(k).len().saturating_sub(1);
            }
            if let Some(p) = self.skeleton.parent[k] {
                self.sides[p] += self.sides[k];
            }
        }
    }

    /// Sums the main stem's chances from the tips down.
    fn follow_main(&mut self, chance: Option<Vec<f64>>) {
        let Some(chance) = chance else { return };
        for k in (0..chance.len()).rev() {
            let Some(p) = self.skeleton.parent[k] else { continue };
            let step = self.skeleton.centres[k].distance(self.skeleton.centres[p]);
            let gain = self.main[k] + step * (2.0 * chance[k] - 1.0);
            self.main[p] = self.main[p].max(gain);
            self.main[k] = gain;
        }
    }

    /// Gives nodes to organs, from the base on: at a fork the organ goes on along one child, and every other child
    /// long enough starts an organ of its own.
    fn walk(&mut self) {
        for k in 0..self.children.len() {
            let organ = self.organ_of[k];
            let branches = self.branches(k);
            let onward = self.onward(k, organ, &branches);
            for c in self.children[k].clone() {
                self.organ_of[c] = if Some(c) == onward || !branches.contains(&c) {
                    organ
                } else {
                    self.organs += 1;
                    self.organs - 1
                };
            }
        }
    }

    /// The children of a node that are no bumps of it.
    fn branches(&self, k: usize) -> Vec<usize> {
        self.children[k].iter().copied().filter(|c| self.is_branch(k, *c)).collect()
    }

    fn is_branch(&self, k: usize, child: usize) -> bool {
        let before = self.back(k, 2);
        let thick = self.radius[k].min(self.radius[before]);
        let step = self.skeleton.centres[k].distance(self.skeleton.centres[child]);
        let least = if self.leaves[child] > 0 { 1.0 } else { BARE } * (self.least + thick);
        self.beyond[child] + step > least
    }

    /// The child along which an organ goes on: the one with most side stems (blades may touch stems that do not carry
    /// them), of equal ones that with most leaves, and then the straightest. A main stem or branch ends at its last fork
    /// unless one child goes straight on.
    fn onward(&self, k: usize, organ: usize, branches: &[usize]) -> Option<usize> {
        // The foot's is what the best way up gains.
        if organ == 0 && self.main[0] > 0.0 {
            let best = self.children[k].iter().copied().max_by(|a, b| self.main[*a].total_cmp(&self.main[*b]));
            return best.filter(|c| self.main[*c] > 0.0);
        }
        let turn = |c: usize| self.straightness(k, c);
        let better = |a: &usize, b: &usize| {
            let most = |x: usize| (self.sides[x], self.leaves[x].max(1));
            most(*a).cmp(&most(*b)).then(turn(*a).total_cmp(&turn(*b)))
        };
        let best = branches.iter().copied().max_by(better)?;
        let carries_several = self.leaves[best] > 1 || (organ != 0 && self.leaves[k] <= 1);
        (branches.len() == 1 || carries_several || turn(best) > STRAIGHT).then_some(best)
    }

    /// Where each stem but the main stem is alone for the first time, the farthest from the foot first.
    fn tracks(&self) -> Vec<Track> {
        let centre = |k: usize| self.skeleton.centres[k];
        let track = |start: usize| {
            let (organ, before) = (self.organ_of[start], self.skeleton.parent[start]?);
            let own = |k: usize| self.children[k].iter().copied().find(|c| self.organ_of[*c] == organ).unwrap_or(k);
            let ahead = (0..AHEAD).fold(start, |k, _| own(k));
            let way = (centre(start) - centre(ahead)).try_normalize()?;
            Some(Track { organ, carrier: self.organ_of[before], at: centre(start), way })
        };
        let is_start = |k: &usize| self.skeleton.parent[*k].is_some_and(|p| self.organ_of[p] != self.organ_of[*k]);
        let mut starts: Vec<usize> = (0..self.children.len()).filter(is_start).collect();
        starts.sort_by(|a, b| self.skeleton.distance[*b].total_cmp(&self.skeleton.distance[*a]));
        starts.into_iter().filter_map(track).collect()
    }

    /// The node `steps` below.
    fn back(&self, k: usize, steps: usize) -> usize {
        (0..steps).fold(k, |k, _| self.skeleton.parent[k].unwrap_or(k))
    }

    /// Cosine between the way to a node and the way on through a child.
    fn straightness(&self, k: usize, child: usize) -> f64 {
        let longest = |k: usize| {
            let longer = |a: &&usize, b: &&usize| self.beyond[**a].total_cmp(&self.beyond[**b]);
            self.children[k].iter().max_by(longer).copied().unwrap_or(k)
        };
        let at = self.skeleton.centres[k];
        let arriving = (at - self.skeleton.centres[self.back(k, AHEAD)]).normalize_or_zero();
        let ahead = (1..AHEAD).fold(child, |k, _| longest(k));
        arriving.dot((self.skeleton.centres[ahead] - at).normalize_or_zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tube of 4 mm from one end to the other.
    fn tube(from: DVec3, to: DVec3) -> impl Iterator<Item = DVec3> {
        let along = (to - from).normalize();
        let (x, y) = (along.any_orthonormal_vector(), along.cross(along.any_orthonormal_vector()));
        let rings = (from.distance(to) / 0.001) as usize;
        (0..=rings).flat_map(move |i| {
            (0..8).map(move |k| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 8.0).sin_cos();
                from.lerp(to, i as f64 / rings as f64) + (x * cos + y * sin) * 0.002
            })
        })
    }

    #[test]
    fn main_stems_go_on_where_side_stems_do_whatever_blades_touch() {
        let up = |z: f64| DVec3::Z * z;
        let petioles = [(0.1, DVec3::X), (0.2, DVec3::Y), (0.25, DVec3::NEG_Y)];
        let mut points: Vec<DVec3> = tube(DVec3::ZERO, up(0.3)).collect();
        points.extend(petioles.iter().flat_map(|(z, way)| tube(up(*z), up(z + 0.05) + *way * 0.15)));
        let stems = points.len();
        // The lowest petiole's own blade, and two that merely touch it.
        let blade = |z: f64, way: DVec3, at: f64| {
            let base = up(z + 0.05 * at) + way * (0.15 * at + 0.002);
            (0..50).map(move |i| base + DVec3::new(way.x, way.y, 0.5) * (0.002 * f64::from(i)))
        };
        let hung = petioles.map(|(z, way)| (z, way, 1.0)).into_iter();
        let mut blades = Vec::new();
        for (z, way, at) in hung.chain([(0.1, DVec3::X, 0.5), (0.1, DVec3::X, 0.75)]) {
            let start = points.len();
            points.extend(blade(z, way, at));
            blades.push((start..points.len()).collect::<Vec<usize>>());
        }
        let members: Vec<usize> = (0..stems).collect();
        let organs = split(&points, &members, &blades, DVec3::ZERO, Habit::Simple, None);
        assert_eq!(organs.len(), 4);
        let main = &organs[0].points;
        assert!(main.iter().any(|p| p.z > 0.29) && main.iter().all(|p| p.x < 0.03), "it follows the petiole");
    }
}
