//! Distances along a cloud instead of through the air: neighbour graphs, shortest paths, level-set skeletons.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use glam::DVec3;

use crate::nearest::Nearest;

/// Neighbours of each point that make up the graph: enough to cross a scan's uneven rows, few enough not to leap
/// between neighbouring organs.
const NEIGHBOURS: usize = 10;

/// A connected graph over a cloud; edges weigh their length in metres.
#[derive(Clone, Debug)]
pub struct CloudGraph {
    edges: Vec<Vec<(u32, f64)>>,
}

/// A total order on finite distances, for heaps.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Metres(f64);

impl Eq for Metres {}

impl PartialOrd for Metres {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Metres {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl CloudGraph {
    /// Joins each point to its nearest 10, then separate pieces by their shortest gap until one piece is left.
    #[must_use]
    pub fn new(points: &[DVec3]) -> Self {
        let tree = Nearest::of(points);
        let mut graph = Self { edges: vec![Vec::new(); points.len()] };
        for (i, p) in points.iter().enumerate() {
            for found in tree.k(*p, NEIGHBOURS + 1) {
                let j = found.index;
                if i < j || (i != j && !graph.edges[j].iter().any(|(k, _)| *k as usize == i)) {
                    graph.join(i, j, found.distance());
                }
            }
        }
        graph.bridge(points);
        graph
    }

    fn join(&mut self, i: usize, j: usize, metres: f64) {
        self.edges[i].push((j as u32, metres));
        self.edges[j].push((i as u32, metres));
    }

    /// Connects pieces, each time the largest with the piece nearest to it.
    fn bridge(&mut self, points: &[DVec3]) {
        let pieces = self.components();
        if pieces.len() < 2 {
            return;
        }
        let mut outside = vec![true; points.len()];
        for i in &pieces[0] {
            outside[*i] = false;
        }
        // Prim over pieces: the gap of every outside point to the connected part, lowered as the part grows.
        let mut gap = vec![(f64::INFINITY, 0usize); points.len()];
        let mut newest = pieces[0].clone();
        let piece_of: Vec<usize> = {
            let mut of = vec![0; points.len()];
            for (k, piece) in pieces.iter().enumerate() {
                for i in piece {
                    of[*i] = k;
                }
            }
            of
        };
        for _ in 1..pieces.len() {
            let part: Vec<DVec3> = newest.iter().map(|i| points[*i]).collect();
            let tree = Nearest::of(&part);
            for i in 0..points.len() {
                if outside[i]
                    && let Some(found) = tree.one(points[i])
                    && found.distance_squared < gap[i].0
                {
                    gap[i] = (found.distance_squared, newest[found.index]);
                }
            }
            let Some(best) = (0..points.len()).filter(|i| outside[*i]).min_by(|a, b| gap[*a].0.total_cmp(&gap[*b].0))
            else {
                return;
            };
            self.join(best, gap[best].1, gap[best].0.sqrt());
            newest.clone_from(&pieces[piece_of[best]]);
            for i in &newest {
                outside[*i] = false;
            }
        }
    }

    /// Connected pieces, largest first, ties by lowest index.
    #[must_use]
    pub fn components(&self) -> Vec<Vec<usize>> {
        let mut pieces = pieces(self.edges.len(), |i| self.edges[i].iter().map(|(j, _)| *j as usize), |_| true);
        pieces.sort_by_key(|piece| (Reverse(piece.len()), piece[0]));
        pieces
    }

    /// Shortest distance along the graph from any of `seeds`, metres.
    #[must_use]
    pub fn distances(&self, seeds: &[usize]) -> Vec<f64> {
        shortest(self.edges.len(), seeds, |i| self.edges[i].iter().map(|(j, metres)| (*j as usize, *metres)))
    }

    /// Neighbours of a point.
    pub fn neighbours(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        self.edges[i].iter().map(|(j, _)| *j as usize)
    }
}

/// Shortest distance from any of `seeds` over edges (neighbour, metres), infinite where no way leads (Dijkstra).
pub(crate) fn shortest<I: Iterator<Item = (usize, f64)>>(
    count: usize,
    seeds: &[usize],
    edges: impl Fn(usize) -> I,
) -> Vec<f64> {
    let mut distance = vec![f64::INFINITY; count];
    let mut heap = BinaryHeap::new();
    for &s in seeds {
        distance[s] = 0.0;
        heap.push(Reverse((Metres(0.0), s as u32)));
    }
    while let Some(Reverse((Metres(d), i))) = heap.pop() {
        if d > distance[i as usize] {
            continue;
        }
        for (j, metres) in edges(i as usize) {
            let through = d + metres;
            if through < distance[j] {
                distance[j] = through;
                heap.push(Reverse((Metres(through), j as u32)));
            }
        }
    }
    distance
}

/// Connected pieces of the points that `keep` admits, in order of their lowest index.
pub(crate) fn pieces<I: Iterator<Item = usize>>(
    count: usize,
    neighbours: impl Fn(usize) -> I,
    keep: impl Fn(usize) -> bool,
) -> Vec<Vec<usize>> {
    let mut seen = vec![false; count];
    let mut found = Vec::new();
    for start in 0..count {
        if seen[start] || !keep(start) {
            continue;
        }
        seen[start] = true;
        let mut piece = vec![start];
        let mut next = 0;
        while next < piece.len() {
            for j in neighbours(piece[next]) {
                if !seen[j] && keep(j) {
                    seen[j] = true;
                    piece.push(j);
                }
            }
            next += 1;
        }
        found.push(piece);
    }
    found
}

/// A branch of a skeleton: a path of level sets.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Index of the branch it leaves, `None` for the trunk.
    pub parent: Option<usize>,
    /// Centres of its level sets from its base on, metres.
    pub centres: Vec<DVec3>,
    /// Points of the cloud that belong to it.
    pub members: Vec<usize>,
}

/// The level-set skeleton of a cloud: connected pieces of equal distance from a base become nodes of a tree, parents
/// before children.
#[derive(Clone, Debug)]
pub struct Skeleton {
    /// Points of each node.
    pub sets: Vec<Vec<usize>>,
    /// Mean of each node's points, metres.
    pub centres: Vec<DVec3>,
    /// Parent of each node, `None` for the one that holds the base.
    pub parent: Vec<Option<usize>>,
    /// Distance of each node from the base along the cloud, metres.
    pub distance: Vec<f64>,
}

impl Skeleton {
    /// The skeleton from the point `base` on; `step` is the thickness of a level in metres.
    #[must_use]
    pub fn of(points: &[DVec3], graph: &CloudGraph, base: usize, step: f64) -> Self {
        let distance = graph.distances(&[base]);
        let level = |i: usize| (distance[i] / step) as u32;
        let sets = pieces_by_level(graph, points.len(), &level);
        let mut set_of = vec![0usize; points.len()];
        for (k, set) in sets.iter().enumerate() {
            for i in set {
                set_of[*i] = k;
            }
        }
        let centres = sets.iter().map(|set| set.iter().map(|i| points[*i]).sum::<DVec3>() / set.len() as f64).collect();
        // A set's parent is the set of the level below that holds most of its edges.
        let parent = sets
            .iter()
            .map(|set| {
                let mut votes = BTreeMap::new();
                for j in set.iter().flat_map(|i| graph.neighbours(*i).map(move |j| (*i, j))) {
                    if distance[j.1] < distance[j.0] && level(j.1) < level(j.0) {
                        *votes.entry(set_of[j.1]).or_insert(0usize) += 1;
                    }
                }
                votes.into_iter().max_by_key(|(k, n)| (*n, Reverse(*k))).map(|(k, _)| k)
            })
            .collect();
        let distance = sets.iter().map(|set| distance[set[0]]).collect();
        Self { sets, centres, parent, distance }
    }

    /// Divides the skeleton into paths. The trunk is the one that `prefer` scores highest by its end node's (centre,
    /// distance from the base); the rest are taken longest first. Parents stand before children.
    #[must_use]
    pub fn branches(&self, prefer: impl Fn(DVec3, f64) -> f64) -> Vec<Branch> {
        paths(&self.sets, &self.centres, &self.parent, |k| prefer(self.centres[k], self.distance[k]))
    }
}

fn pieces_by_level(graph: &CloudGraph, count: usize, level: &impl Fn(usize) -> u32) -> Vec<Vec<usize>> {
    let mut sets = pieces(count, |i| graph.neighbours(i).filter(move |j| level(*j) == level(i)), |_| true);
    // Parents (lower levels) first.
    sets.sort_by_key(|set| (level(set[0]), set[0]));
    sets
}

/// Divides a tree of level sets into paths.
fn paths(
    sets: &[Vec<usize>],
    centres: &[DVec3],
    parent: &[Option<usize>],
    score: impl Fn(usize) -> f64,
) -> Vec<Branch> {
    let n = sets.len();
    let mut is_end = vec![true; n];
    for p in parent.iter().flatten() {
        is_end[*p] = false;
    }
    let path = |end: usize, owner: &[Option<usize>]| {
        let mut nodes = vec![end];
        while let Some(p) = parent[nodes[nodes.len() - 1]] {
            if owner[p].is_some() {
                return (nodes, owner[p]);
            }
            nodes.push(p);
        }
        (nodes, None)
    };
    let length = |nodes: &[usize]| nodes.windows(2).map(|w| centres[w[0]].distance(centres[w[1]])).sum::<f64>();
    let mut owner: Vec<Option<usize>> = vec![None; n];
    let mut branches: Vec<Branch> = Vec::new();
    let mut ends: Vec<usize> = (0..n).filter(|k| is_end[*k]).collect();
    while !ends.is_empty() {
        let value = |end: usize| if branches.is_empty() { score(end) } else { length(&path(end, &owner).0) };
        let values: Vec<f64> = ends.iter().map(|end| value(*end)).collect();
        let best = (0..ends.len()).fold(0, |best, k| if values[k] > values[best] { k } else { best });
        let (mut nodes, from) = path(ends.swap_remove(best), &owner);
        nodes.reverse();
        for k in &nodes {
            owner[*k] = Some(branches.len());
        }
        branches.push(Branch {
            parent: from,
            centres: nodes.iter().map(|k| centres[*k]).collect(),
            members: nodes.iter().flat_map(|k| sets[*k].iter().copied()).collect(),
        });
        ends.sort_unstable();
    }
    branches
}

/// Takes out branches shorter than `least` metres beyond their parent's thickness; their points, and those of what
/// they carried, go to the branch they left. The trunk stays.
#[must_use]
pub fn prune(branches: Vec<Branch>, points: &[DVec3], least: f64) -> Vec<Branch> {
    let mut kept: Vec<Branch> = Vec::new();
    // Where each old branch's points went.
    let mut goes_to: Vec<usize> = Vec::with_capacity(branches.len());
    for branch in branches {
        let Some(parent) = branch.parent.map(|p| goes_to[p]) else {
            goes_to.push(kept.len());
            kept.push(branch);
            continue;
        };
        let fork = nearest_centre(&kept[parent].centres, branch.centres[0]);
        let reach = branch.centres.iter().map(|c| c.distance(fork)).fold(0.0, f64::max);
        if reach < least + thickness(&kept[parent], points, fork, least) {
            kept[parent].members.extend(branch.members);
            goes_to.push(parent);
        } else {
            goes_to.push(kept.len());
            kept.push(Branch { parent: Some(parent), ..branch });
        }
    }
    kept
}

fn nearest_centre(centres: &[DVec3], p: DVec3) -> DVec3 {
    centres.iter().copied().min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p))).unwrap_or(p)
}

/// Mean distance of a branch's points near `at` to its centres there: about its radius.
fn thickness(branch: &Branch, points: &[DVec3], at: DVec3, within: f64) -> f64 {
    let near = branch.members.iter().map(|i| points[*i].distance(at)).filter(|d| *d < 2.0 * within);
    let (sum, n) = near.fold((0.0, 0usize), |(s, n), d| (s + d, n + 1));
    if n == 0 { 0.0 } else { sum / n as f64 }
}
