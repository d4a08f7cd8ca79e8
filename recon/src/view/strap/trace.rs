//! The main stem and the blades of a grass as lines in the picture.

use glam::DVec2;

use super::network::Network;
use super::silhouette::Silhouette;
use crate::statistics::median;

/// A stem gains by what rises more than this part of its length, 40 degrees off the vertical (a guess: stems lean, blades
/// leave them at more).
const ONWARD: f64 = 0.77;
/// What a full turn about costs a stem, in plant sizes (a guess).
const STEM_TURN: f64 = 0.02;
/// A foot stands under the middle of its plant: off it by this share of the plant's width it counts a third (a guess).
const OFF_MIDDLE: f64 = 0.25;
/// What a full turn about costs a blade on its way, in plant sizes, and what meeting the stem from below costs it: straps
/// go straight over crossings and rise from their stems (guesses).
const TURN: f64 = 0.5;
const FROM_BELOW: f64 = 0.1;
/// A blade is told by a way of its own of at least so many half widths, and of at least this share of its plant's size;
/// shorter ones are its wavy edge (guesses).
const OWN_WIDTHS: f64 = 4.0;
const OWN_SHARE: f64 = 0.035;
/// Lines from the stem that no blade took are blades whose tips lie on others when they are this share of the plant's
/// size (a guess).
const LEFT_OVER: f64 = 0.07;

/// A line in the picture with the half width of what it is the middle of, pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stroke {
    /// Its points, a pixel or so apart.
    pub points: Vec<DVec2>,
    /// Half width at each.
    pub radii: Vec<f64>,
}

/// A grass as lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// The main stem, from its foot up.
    pub stem: Stroke,
    /// The blades, each from the stem to its tip, lowest on the stem first.
    pub blades: Vec<Stroke>,
}

/// A line walked from its end 0 or 1 to the other.
type Walk = (usize, usize);

impl Sketch {
    /// Of the silhouette of one plant seen from the side, up being up; `None` when it has no stem with a blade.
    #[must_use]
    pub fn of(shape: &Silhouette) -> Option<Self> {
        let network = Network::of(shape)?;
        let plant = Plant::of(shape, network)?;
        let stem = plant.stem()?;
        let blades = plant.blades(&stem);
        (!blades.is_empty()).then(|| Self {
            stem: plant.stroke(&stem),
            blades: blades.iter().map(|walks| plant.stroke(walks)).collect(),
        })
    }
}

/// A network with the box of its shape.
struct Plant {
    network: Network,
    /// Half of the shape's pixels lie left of it.
    middle: f64,
    width: f64,
    /// The box's diagonal.
    size: f64,
}

impl Plant {
    fn of(shape: &Silhouette, network: Network) -> Option<Self> {
        let (mut columns, mut rows): (Vec<usize>, Vec<usize>) = (0..shape.inside().len())
            .filter(|&p| shape.inside()[p])
            .map(|p| (p % shape.width(), p / shape.width()))
            .unzip();
        columns.sort_unstable();
        rows.sort_unstable();
        let width = (columns.last()? - columns.first()?) as f64;
        let height = (rows.last()? - rows.first()?) as f64;
        Some(Self { network, middle: columns[columns.len() / 2] as f64, width, size: width.hypot(height) })
    }

    /// The node where a walk begins.
    fn start(&self, (line, from): Walk) -> usize {
        self.network.lines[line].nodes[from]
    }

    fn place(&self, node: usize) -> DVec2 {
        self.network.place(self.network.at[node])
    }

    /// The node where a walk ends.
    fn end(&self, (line, from): Walk) -> usize {
        self.network.lines[line].nodes[1 - from]
    }

    /// Direction of a walk where it ends.
    fn arriving(&self, (line, from): Walk) -> DVec2 {
        -self.network.leaving(line, 1 - from)
    }

    fn length(&self, walk: Walk) -> f64 {
        self.network.lines[walk.0].length
    }

    /// The main stem as walks from its foot to its last fork: of the ways that rise most for their length the highest,
    /// thickest and most central one.
    fn stem(&self) -> Option<Vec<Walk>> {
        let (gain, next) = self.ascents();
        let score = |&start: &Walk| {
            let way = climbed(start, &next);
            let height = self.rise(start, way[way.len() - 1]);
            let pixels = way.iter().flat_map(|walk| &self.network.lines[walk.0].pixels);
            let thick = median(pixels.map(|&p| self.network.radius(p)).collect::<Vec<_>>()).unwrap_or(0.0);
            let off = (self.place(self.start(start)).x - self.middle) / (OFF_MIDDLE * self.width).max(1.0);
            (height * gain[key(start)] * thick).sqrt() * (-off * off).exp()
        };
        let starts = self.network.nodes.iter().flatten().copied().filter(|&start| gain[key(start)] > 0.0);
        let foot = starts.max_by(|a, b| score(a).total_cmp(&score(b)))?;
        let mut way = climbed(foot, &next);
        // What ends in a tip is the last blade and not the stem.
        if self.network.is_tip(self.end(way[way.len() - 1])) {
            way.pop();
        }
        (!way.is_empty()).then_some(way)
    }

    /// How much higher the end of the last walk is than the start of the first.
    fn rise(&self, first: Walk, last: Walk) -> f64 {
        self.place(self.start(first)).y - self.place(self.end(last)).y
    }

    /// By `key`, how much the best way that begins with each walk rises beyond [`ONWARD`] of its length and its turns, and
    /// the walk that follows. Every round trip loses, so there is a best way, and it passes nothing twice.
    fn ascents(&self) -> (Vec<f64>, Vec<Option<Walk>>) {
        let walks: Vec<Walk> = (0..self.network.lines.len()).flat_map(|line| [(line, 0), (line, 1)]).collect();
        let own: Vec<f64> = walks.iter().map(|&walk| self.rise(walk, walk) - ONWARD * self.length(walk)).collect();
        let (mut gain, mut next) = (own.clone(), vec![None; own.len()]);
        for _ in 0..walks.len() {
            let mut changed = false;
            for &walk in &walks {
                let here = self.arriving(walk);
                for &onward in self.network.nodes[self.end(walk)].iter().filter(|onward| onward.0 != walk.0) {
                    let turn = (1.0 - here.dot(self.network.leaving(onward.0, onward.1))) / 2.0;
                    let through = own[key(walk)] + gain[key(onward)] - STEM_TURN * self.size * turn;
                    if through > gain[key(walk)] {
                        (gain[key(walk)], next[key(walk)], changed) = (through, Some(onward), true);
                    }
                }
            }
            if !changed {
                break;
            }
        }
        (gain, next)
    }

    /// Ways from the stem to the tips of blades.
    fn blades(&self, stem: &[Walk]) -> Vec<Vec<Walk>> {
        let mut on_stem = vec![false; self.network.nodes.len()];
        let mut taken = vec![false; self.network.lines.len()];
        on_stem[self.network.lines[stem[0].0].nodes[stem[0].1]] = true;
        for &walk in stem {
            on_stem[self.end(walk)] = true;
            taken[walk.0] = true;
        }
        let ways = Ways::of(self, &on_stem, &taken);
        let tips = (0..self.network.nodes.len()).filter(|&node| self.network.is_tip(node) && !on_stem[node]);
        let mut found: Vec<Vec<Walk>> = tips.filter_map(|tip| ways.from(self.network.nodes[tip][0])).collect();
        // The longest first: what the others have for themselves says whether they are blades.
        let length = |way: &[Walk]| way.iter().map(|walk| self.length(*walk)).sum::<f64>();
        found.sort_by(|a, b| length(b).total_cmp(&length(a)));
        let mut blades = Vec::new();
        for way in found {
            let own: Vec<Walk> = way.iter().copied().take_while(|walk| !taken[walk.0]).collect();
            let Some(&(last, _)) = own.last() else { continue };
            let joint = self.network.radius(self.network.at[self.end(own[own.len() - 1])]);
            if length(&own) - joint < (OWN_WIDTHS * self.half_width(last)).max(OWN_SHARE * self.size) {
                continue;
            }
            own.iter().for_each(|walk| taken[walk.0] = true);
            blades.push(way);
        }
        for line in 0..self.network.lines.len() {
            if taken[line] || self.network.lines[line].length < LEFT_OVER * self.size {
                continue;
            }
            // From blade to blade go crossings and holes: a blade comes from the stem on a way of its own.
            let is_own = |way: &Vec<Walk>| way.iter().all(|walk| !taken[walk.0]);
            let ways = [0, 1].into_iter().filter_map(|end| ways.from((line, end))).filter(is_own);
            if let Some(way) = ways.min_by(|a, b| length(a).total_cmp(&length(b))) {
                way.iter().for_each(|walk| taken[walk.0] = true);
                blades.push(way);
            }
        }
        // From the stem outwards, lowest first.
        let mut blades: Vec<Vec<Walk>> =
            blades.into_iter().map(|way| way.into_iter().rev().map(|(line, end)| (line, 1 - end)).collect()).collect();
        let foot =
            |way: &Vec<Walk>| self.network.place(self.network.at[self.network.lines[way[0].0].nodes[way[0].1]]).y;
        blades.sort_by(|a, b| foot(b).total_cmp(&foot(a)));
        blades
    }

    fn half_width(&self, line: usize) -> f64 {
        let pixels = &self.network.lines[line].pixels;
        pixels.iter().map(|&p| self.network.radius(p)).sum::<f64>() / pixels.len() as f64
    }

    fn stroke(&self, walks: &[Walk]) -> Stroke {
        let mut stroke = Stroke::default();
        for &(line, end) in walks {
            let pixels = &self.network.lines[line].pixels;
            let mut add = |p: usize| {
                stroke.points.push(self.network.place(p));
                stroke.radii.push(self.network.radius(p));
            };
            if end == 0 { pixels.iter().for_each(|&p| add(p)) } else { pixels.iter().rev().for_each(|&p| add(p)) }
        }
        stroke
    }
}

/// The way that begins with a walk.
fn climbed(start: Walk, next: &[Option<Walk>]) -> Vec<Walk> {
    std::iter::successors(Some(start), |&walk| next[key(walk)]).collect()
}

/// The cheapest way to the stem from every walk.
struct Ways {
    /// Cost from the beginning of the walk, by `2 * line + end`.
    cost: Vec<f64>,
    next: Vec<Option<Walk>>,
}

const fn key((line, end): Walk) -> usize {
    2 * line + end
}

impl Ways {
    fn of(plant: &Plant, on_stem: &[bool], taken: &[bool]) -> Self {
        let network = &plant.network;
        let count = 2 * network.lines.len();
        let mut ways = Self { cost: vec![f64::INFINITY; count], next: vec![None; count] };
        let mut open: Vec<Walk> = Vec::new();
        for line in (0..network.lines.len()).filter(|&line| !taken[line]) {
            for walk in [(line, 0), (line, 1)] {
                if on_stem[plant.end(walk)] {
                    let below = (1.0 - plant.arriving(walk).y) / 2.0;
                    ways.cost[key(walk)] = plant.length(walk) + FROM_BELOW * plant.size * below;
                }
                open.push(walk);
            }
        }
        // Dijkstra without a heap: a plant has some hundred lines.
        while let Some(k) = (0..open.len()).min_by(|&a, &b| ways.cost[key(open[a])].total_cmp(&ways.cost[key(open[b])]))
        {
            let after = open.swap_remove(k);
            let cost = ways.cost[key(after)];
            if cost == f64::INFINITY {
                break;
            }
            let (line, end) = after;
            let onward = network.leaving(line, end);
            for &(before, at) in &network.nodes[network.lines[line].nodes[end]] {
                if before == line || taken[before] || on_stem[network.lines[line].nodes[end]] {
                    continue;
                }
                // The walk that ends here began at the line's other end.
                let walk = (before, 1 - at);
                let turn = (1.0 - plant.arriving(walk).dot(onward)) / 2.0;
                let through = plant.length(walk) + TURN * plant.size * turn + cost;
                if through < ways.cost[key(walk)] {
                    ways.cost[key(walk)] = through;
                    ways.next[key(walk)] = Some(after);
                }
            }
        }
        ways
    }

    /// The way that begins with a walk, `None` when it never meets the stem.
    fn from(&self, walk: Walk) -> Option<Vec<Walk>> {
        let mut way = vec![walk];
        if !self.cost[key(walk)].is_finite() {
            return None;
        }
        while let Some(next) = self.next[key(way[way.len() - 1])] {
            if way.len() > self.next.len() {
                return None;
            }
            way.push(next);
        }
        Some(way)
    }
}

#[cfg(test)]
mod tests;
