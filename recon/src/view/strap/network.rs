//! A silhouette's middle lines as a graph.

use glam::{DVec2, DVec3};

use super::silhouette::Silhouette;
use crate::graph::pieces;
use crate::nearest::Nearest;

/// Side lines shorter than this many radii of the shape at their joint come of its raggedness (a guess: a blade's tip
/// stands farther out).
const SPUR: f64 = 1.6;
/// Rounds of pruning; each takes one spur a joint.
const ROUNDS: usize = 12;
/// Parts of a silhouette that lie apart are one plant over gaps of at most this share of its diagonal: glare cuts blades
/// (a guess).
const GAP: f64 = 0.04;
/// Most parts that are joined, the largest first; the rest are specks.
const MAX_PARTS: usize = 32;
/// Most lines of a plant: what follows looks at pairs of them, and the largest maize has some two hundred.
const MAX_LINES: usize = 2_000;
/// A line's direction at a node is taken over this many radii, from outside the node's disc on.
const BASELINE: f64 = 3.0;
/// And at least over so many pixels.
const MIN_BASELINE: f64 = 8.0;

/// A line between two nodes.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// Where it begins and ends.
    pub nodes: [usize; 2],
    /// Its pixels in that order.
    pub pixels: Vec<usize>,
    /// Pixels along it.
    pub length: f64,
}

/// Middle lines and how they meet.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub width: usize,
    /// Half of the shape's width at each pixel of the picture.
    pub radii: Vec<f32>,
    pub lines: Vec<Line>,
    /// Lines that begin or end at each node, with which of their ends.
    pub nodes: Vec<Vec<(usize, usize)>>,
    /// Pixel of each node.
    pub at: Vec<usize>,
}

impl Network {
    /// Of a silhouette: thinned, its parts joined, spurs pruned; `None` when it has too many lines for a plant.
    pub(super) fn of(shape: &Silhouette) -> Option<Self> {
        let radii = shape.radii();
        let mut thin = Thin::of(shape);
        thin.join();
        let mut network = thin.network(radii);
        for _ in 0..ROUNDS {
            let spurs = network.spurs();
            if spurs.is_empty() {
                break;
            }
            for spur in spurs {
                let Line { nodes, pixels, .. } = &network.lines[spur];
                let free = usize::from(network.nodes[nodes[0]].len() > 1);
                let all_but_joint = if free == 1 { &pixels[1..] } else { &pixels[..pixels.len() - 1] };
                all_but_joint.iter().for_each(|&p| thin.inside[p] = false);
            }
            network = thin.network(network.radii);
        }
        (network.lines.len() <= MAX_LINES).then(|| network.merged())
    }

    /// Place of a pixel's centre.
    pub(super) fn place(&self, pixel: usize) -> DVec2 {
        DVec2::new((pixel % self.width) as f64 + 0.5, (pixel / self.width) as f64 + 0.5)
    }

    /// Half of the shape's width at a pixel.
    pub(super) fn radius(&self, pixel: usize) -> f64 {
        f64::from(self.radii[pixel])
    }

    /// Direction in which a line leaves its node at `end` (0 or 1).
    pub(super) fn leaving(&self, line: usize, end: usize) -> DVec2 {
        let pixels = &self.lines[line].pixels;
        let at = |k: usize| self.place(if end == 0 { pixels[k] } else { pixels[pixels.len() - 1 - k] });
        let radius = self.radius(self.at[self.lines[line].nodes[end]]);
        let span = (BASELINE * radius).max(MIN_BASELINE);
        let last = pixels.len() - 1;
        // Inside the node's disc the middle line bends to the node.
        let from = (radius as usize).min(last / 2);
        let to = (from + span as usize).min(last);
        (at(to) - at(from)).normalize_or_zero()
    }

    /// Whether a node is the end of one line.
    pub(super) fn is_tip(&self, node: usize) -> bool {
        self.nodes[node].len() == 1
    }

    /// The shortest spur of every joint that has some.
    fn spurs(&self) -> Vec<usize> {
        let mut shortest: Vec<Option<usize>> = vec![None; self.nodes.len()];
        for (k, line) in self.lines.iter().enumerate() {
            let [a, b] = line.nodes;
            let joint = match (self.is_tip(a), self.is_tip(b)) {
                (true, false) => b,
                (false, true) => a,
                _ => continue,
            };
            let is_spur = line.length < SPUR * self.radius(self.at[joint]);
            let is_shorter = shortest[joint].is_none_or(|other| line.length < self.lines[other].length);
            if is_spur && is_shorter {
                shortest[joint] = Some(k);
            }
        }
        shortest.into_iter().flatten().collect()
    }

    /// The same with joints whose discs overlap made one: thinning draws crossings as two forks.
    fn merged(mut self) -> Self {
        let mut group: Vec<usize> = (0..self.nodes.len()).collect();
        let is_short = |line: &Line| {
            let radius = line.nodes.map(|n| self.radius(self.at[n])).into_iter().fold(0.0, f64::max);
            line.nodes.iter().all(|&n| !self.is_tip(n)) && line.length <= radius
        };
        let short: Vec<bool> = self.lines.iter().map(is_short).collect();
        for (line, _) in self.lines.iter().zip(&short).filter(|(_, short)| **short) {
            let [a, b] = line.nodes.map(|n| group[n]);
            group.iter_mut().filter(|g| **g == b).for_each(|g| *g = a);
        }
        let mut lines = Vec::new();
        for (mut line, short) in self.lines.into_iter().zip(short) {
            line.nodes = line.nodes.map(|n| group[n]);
            if !(short && line.nodes[0] == line.nodes[1]) {
                lines.push(line);
            }
        }
        self.nodes = incidence(self.at.len(), &lines);
        self.lines = lines;
        self
    }
}

fn incidence(count: usize, lines: &[Line]) -> Vec<Vec<(usize, usize)>> {
    let mut nodes = vec![Vec::new(); count];
    for (k, line) in lines.iter().enumerate() {
        for end in 0..2 {
            nodes[line.nodes[end]].push((k, end));
        }
    }
    nodes
}

/// Pixels of middle lines.
struct Thin {
    shape: Silhouette,
    inside: Vec<bool>,
}

impl Thin {
    fn of(shape: &Silhouette) -> Self {
        let inside = shape.thinned().inside().to_vec();
        Self { shape: shape.clone(), inside }
    }

    /// Neighbours along the lines: no diagonal where two straight steps lead there.
    fn neighbours(&self, p: usize) -> impl Iterator<Item = usize> + use<> {
        let ring = self.shape.ring(p);
        let inside = ring.map(|q| self.inside[q]);
        let is_step = move |k: usize| inside[k] && (k.is_multiple_of(2) || !(inside[k - 1] || inside[(k + 1) % 8]));
        (0..8).filter(move |&k| is_step(k)).map(move |k| ring[k])
    }

    /// Connected parts, largest first.
    fn parts(&self) -> Vec<Vec<usize>> {
        let mut parts = pieces(self.inside.len(), |p| self.shape.ring(p).into_iter(), |p| self.inside[p]);
        parts.sort_by_key(|part| (std::cmp::Reverse(part.len()), part[0]));
        parts
    }

    /// Draws straight lines over the gaps between parts of one plant; what lies farther off goes.
    fn join(&mut self) {
        let width = self.shape.width();
        let place = |p: usize| DVec3::new((p % width) as f64, (p / width) as f64, 0.0);
        let mut parts = self.parts().into_iter();
        let Some(mut whole) = parts.next() else { return };
        let diagonal = (width as f64).hypot(self.shape.height() as f64);
        for (k, part) in parts.enumerate() {
            let tree = Nearest::of(&part.iter().map(|&p| place(p)).collect::<Vec<_>>());
            let gap = |&p: &usize| Some((tree.one(place(p))?, p));
            let searched = if k < MAX_PARTS { &whole[..] } else { &[] };
            let nearest =
                searched.iter().filter_map(gap).min_by(|a, b| a.0.distance_squared.total_cmp(&b.0.distance_squared));
            match nearest.filter(|(found, _)| found.distance() <= GAP * diagonal) {
                Some((found, from)) => {
                    let (from, to) = (place(from), place(part[found.index]));
                    let steps = (from - to).abs().max_element().max(1.0) as usize;
                    for k in 0..=steps {
                        let at = from.lerp(to, k as f64 / steps as f64).round();
                        self.inside[at.y as usize * width + at.x as usize] = true;
                    }
                    whole.extend(part);
                }
                None => part.iter().for_each(|&p| self.inside[p] = false),
            }
        }
    }

    fn network(&self, radii: Vec<f32>) -> Network {
        let width = self.shape.width();
        let degree = |p: usize| self.neighbours(p).count();
        let at: Vec<usize> = (0..self.inside.len()).filter(|&p| self.inside[p] && degree(p) != 2).collect();
        let mut node_of = vec![usize::MAX; self.inside.len()];
        at.iter().enumerate().for_each(|(k, &p)| node_of[p] = k);
        let mut lines = Vec::new();
        for &start in &at {
            for first in self.neighbours(start) {
                let mut pixels = vec![start, first];
                while node_of[pixels[pixels.len() - 1]] == usize::MAX {
                    let (before, here) = (pixels[pixels.len() - 2], pixels[pixels.len() - 1]);
                    let Some(next) = self.neighbours(here).find(|&q| q != before) else { break };
                    pixels.push(next);
                }
                let end = pixels[pixels.len() - 1];
                // Each line is walked from both of its ends; one of the two walks is kept.
                let forth = (start, first);
                let back = (end, pixels[pixels.len() - 2]);
                if forth <= back && node_of[end] != usize::MAX {
                    let step = |pair: &[usize]| match pair[0].abs_diff(pair[1]) {
                        1 => 1.0,
                        across if across == width => 1.0,
                        _ => std::f64::consts::SQRT_2,
                    };
                    let length = pixels.windows(2).map(step).sum();
                    lines.push(Line { nodes: [node_of[start], node_of[end]], pixels, length });
                }
            }
        }
        let nodes = incidence(at.len(), &lines);
        Network { width, radii, lines, nodes, at }
    }
}
