//! The main stem and the blades of a grass as lines in the picture.

use glam::DVec2;

use super::network::Network;
use super::silhouette::Silhouette;
use crate::statistics::median;

/// A stem goes on upwards while its direction keeps within about 40 degrees of both the vertical and the way from its foot
/// (cosine; a guess: stems lean, blades leave them at more).
const ONWARD: f64 = 0.77;
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

    /// The main stem as walks from its foot to its last fork: of the ways up from every tip and joint the highest,
    /// straightest, thickest and most central one.
    fn stem(&self) -> Option<Vec<Walk>> {
        let starts = self.network.nodes.iter().flatten();
        let rising = starts.filter(|&&(line, end)| -self.network.leaving(line, end).y > ONWARD);
        let ways = rising.map(|&start| self.way_up(start)).filter(|way| !way.is_empty());
        ways.max_by(|a, b| self.stem_score(a).total_cmp(&self.stem_score(b)))
    }

    fn way_up(&self, start: Walk) -> Vec<Walk> {
        let up = DVec2::NEG_Y;
        let mut way = vec![start];
        let foot = self.place(self.start(start));
        loop {
            let last = way[way.len() - 1];
            let so_far = (self.place(self.end(last)) - foot).normalize_or_zero();
            let onward = |&walk: &Walk| {
                let chord = (self.place(self.end(walk)) - self.place(self.start(walk))).normalize_or_zero();
                let there = self.network.leaving(walk.0, walk.1);
                (there.dot(up).min(there.dot(so_far)).min(chord.dot(so_far)), walk)
            };
            let next = self.network.nodes[self.end(last)].iter().filter(|(line, _)| way.iter().all(|w| w.0 != *line));
            match next.map(onward).max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((score, walk)) if score > ONWARD => way.push(walk),
                _ => break,
            }
        }
        // What ends in a tip is the last blade and not the stem.
        if self.network.is_tip(self.end(way[way.len() - 1])) {
            way.pop();
        }
        way
    }

    fn stem_score(&self, way: &[Walk]) -> f64 {
        let stroke = self.stroke(way);
        let (first, last) = (stroke.points[0], stroke.points[stroke.points.len() - 1]);
        let length: f64 = way.iter().map(|walk| self.length(*walk)).sum();
        let straight = first.distance(last) / length.max(1.0);
        let thick = median(&stroke.radii).unwrap_or(0.0);
        let off = (first.x - self.middle) / (OFF_MIDDLE * self.width).max(1.0);
        (first.y - last.y).max(0.0) * straight.powi(4) * thick.sqrt() * (-off * off).exp()
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
mod tests {
    use super::*;
    use image::{GrayImage, Luma};

    /// A brush stroke along a quadratic Bézier curve, its half width falling from `radius` to nothing at the end.
    fn stroke(picture: &mut GrayImage, [a, b, c]: [DVec2; 3], radius: f64, taper: f64) {
        for k in 0..=2000 {
            let t = f64::from(k) / 2000.0;
            let at = a.lerp(b, t).lerp(b.lerp(c, t), t);
            let r = radius * (1.0 - taper * t);
            for y in (at.y - r).floor() as i32..=(at.y + r).ceil() as i32 {
                for x in (at.x - r).floor() as i32..=(at.x + r).ceil() as i32 {
                    let inside = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5).distance(at) <= r;
                    if inside && x >= 0 && y >= 0 && (x as u32) < picture.width() && (y as u32) < picture.height() {
                        picture.put_pixel(x as u32, y as u32, Luma([255]));
                    }
                }
            }
        }
    }

    /// An upright stem with strap leaves: (height of the node, reach to the right, rise, fall of the tip below its top).
    fn maize(leaves: &[(f64, f64, f64, f64)]) -> (GrayImage, Vec<f64>) {
        let mut picture = GrayImage::new(400, 440);
        let foot = DVec2::new(200.0, 420.0);
        let top = leaves.iter().map(|leaf| leaf.0).fold(0.0, f64::max);
        stroke(&mut picture, [foot, foot - DVec2::Y * top / 2.0, foot - DVec2::Y * top], 6.0, 0.3);
        let mut lengths = Vec::new();
        for &(node, reach, rise, fall) in leaves {
            let from = foot - DVec2::Y * node;
            let curve = [from, from + DVec2::new(reach * 0.5, -2.0 * rise), from + DVec2::new(reach, fall - rise)];
            stroke(&mut picture, curve, 4.0, 0.8);
            let at = |t: f64| curve[0].lerp(curve[1], t).lerp(curve[1].lerp(curve[2], t), t);
            lengths.push((0..100).map(|k| at(f64::from(k) / 100.0).distance(at(f64::from(k + 1) / 100.0))).sum());
        }
        (picture, lengths)
    }

    fn length(stroke: &Stroke) -> f64 {
        let few: Vec<DVec2> = stroke.points.iter().copied().step_by(5).chain(stroke.points.last().copied()).collect();
        few.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
    }

    #[test]
    fn leaves_are_counted_and_measured_lowest_first() {
        let (picture, lengths) = maize(&[
            (80.0, 120.0, 60.0, 40.0),
            (140.0, -130.0, 70.0, 60.0),
            (200.0, 110.0, 70.0, 20.0),
            (260.0, -60.0, 100.0, 0.0),
            (262.0, 40.0, 120.0, 0.0),
        ]);
        let sketch = Sketch::of(&Silhouette::of(&picture)).unwrap();
        assert_eq!(sketch.blades.len(), lengths.len());
        assert!((sketch.stem.points[0].x - 200.0).abs() < 5.0 && sketch.stem.points[0].y > 400.0);
        for (blade, expected) in sketch.blades.iter().zip(&lengths).take(3) {
            let found = length(blade);
            assert!((found / expected - 1.0).abs() < 0.1, "{found} instead of {expected}");
        }
    }

    #[test]
    fn blades_go_straight_over_crossings() {
        // The lower leaf's arch is crossed by the hanging tip of the upper one, well off the stem.
        let (picture, lengths) = maize(&[
            (60.0, 160.0, 110.0, 60.0),
            (200.0, 160.0, 10.0, 160.0),
            (240.0, -60.0, 100.0, 0.0),
            (242.0, 40.0, 120.0, 0.0),
        ]);
        let sketch = Sketch::of(&Silhouette::of(&picture)).unwrap();
        assert_eq!(sketch.blades.len(), 4);
        let found: Vec<f64> = sketch.blades.iter().map(length).collect();
        for (found, expected) in found.iter().zip(&lengths).take(2) {
            assert!((found / expected - 1.0).abs() < 0.12, "{found} instead of {expected}");
        }
    }

    #[test]
    fn holes_between_blades_add_none() {
        let leaves = [
            (80.0, 120.0, 60.0, 40.0),
            (140.0, -130.0, 70.0, 60.0),
            (200.0, 160.0, 60.0, 40.0),
            (260.0, -60.0, 100.0, 0.0),
            (262.0, 40.0, 120.0, 0.0),
        ];
        let (mut picture, lengths) = maize(&leaves);
        // From a blade's rise to its fall.
        let ends = [DVec2::new(248.0, 168.0), DVec2::new(328.0, 169.0)];
        stroke(&mut picture, [ends[0], ends[0].midpoint(ends[1]), ends[1]], 3.0, 0.0);
        let sketch = Sketch::of(&Silhouette::of(&picture)).unwrap();
        assert_eq!(sketch.blades.len(), lengths.len());
    }

    #[test]
    fn what_has_no_stem_with_blades_is_no_grass() {
        let mut disc = GrayImage::new(100, 100);
        stroke(&mut disc, [DVec2::splat(50.0); 3], 30.0, 0.0);
        let mut bar = GrayImage::new(100, 100);
        stroke(&mut bar, [DVec2::new(50.0, 90.0), DVec2::new(50.0, 50.0), DVec2::new(50.0, 10.0)], 4.0, 0.0);
        for picture in
            [disc, bar, GrayImage::new(100, 100), GrayImage::new(0, 0), GrayImage::from_pixel(3, 9, Luma([1]))]
        {
            assert_eq!(Sketch::of(&Silhouette::of(&picture)), None);
        }
        // Noise has more lines than any plant, and must not take longer.
        let mut rng = crate::world::seeded(1);
        let noise = GrayImage::from_fn(400, 400, |_, _| Luma([u8::from(rand::Rng::random_bool(&mut rng, 0.4))]));
        assert_eq!(Sketch::of(&Silhouette::of(&noise)), None);
    }
}
