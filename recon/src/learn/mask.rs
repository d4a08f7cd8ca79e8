//! Which pixels of a mask are the blade: its largest region, with holes filled, without the petiole.

use glam::DVec2;
use image::GrayImage;

use super::outline::{Ends, OutlineError};
use crate::distance::distances;
use crate::graph::pieces;

/// A pixel above this grey is leaf; masks are black and white, so any middle will do.
const LEAF_ABOVE: u8 = 127;
/// Fewer pixels than this show no shape (a guess: a leaf of about 30 by 15).
const LEAST_PIXELS: usize = 300;
/// A petiole is thinner than this share of the blade's largest inscribed circle (a guess that holds for the
/// silhouettes at hand; lobes are wider at their root).
const PETIOLE_SHARE: f64 = 0.12;
/// A petiole is longer than this many of its largest radii, or it is a pointed end: a wedge of 39 degrees reaches 2.
const PETIOLE_LENGTH: f64 = 2.0;
/// A given base's petiole starts in this share of the blade at that end.
const BASE_SHARE: f64 = 0.25;

/// One region of a mask; pixel (x, y) with y down.
#[derive(Clone, Debug)]
pub(super) struct Region {
    width: usize,
    height: usize,
    inside: Vec<bool>,
}

/// A blade's pixels and what was seen on the way to them.
#[derive(Clone, Debug)]
pub(super) struct BladePixels {
    /// The blade.
    pub(super) region: Region,
    /// Where the petiole was cut off, pixels.
    pub(super) junction: Option<DVec2>,
    /// Area of all other regions of the mask, as a share of this one.
    pub(super) others: f64,
}

impl BladePixels {
    /// The blade of a mask.
    pub(super) fn of(mask: &GrayImage, ends: Ends) -> Result<Self, OutlineError> {
        let (width, height) = (mask.width() as usize, mask.height() as usize);
        let inside: Vec<bool> = mask.as_raw().iter().map(|grey| *grey > LEAF_ABOVE).collect();
        let total = inside.iter().filter(|inside| **inside).count();
        let whole = Region { width, height, inside }.largest();
        let area = whole.area();
        if area < LEAST_PIXELS {
            return Err(OutlineError::Small { expected: LEAST_PIXELS, found: area });
        }
        let others = (total - area) as f64 / area as f64;
        let filled = whole.filled();
        let (region, junction) = match filled.petiole(ends) {
            Some(petiole) => filled.without(&petiole),
            None => (filled, None),
        };
        Ok(Self { region, junction, others })
    }
}

impl Region {
    /// True for a pixel of the region; false outside the picture.
    pub(super) fn has(&self, x: i64, y: i64) -> bool {
        let within = x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64;
        within && self.inside[y as usize * self.width + x as usize]
    }

    /// Width and height of the picture, pixels.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The first pixel from above, of several the leftmost.
    pub(super) fn first(&self) -> Option<(i64, i64)> {
        let first = self.inside.iter().position(|inside| *inside)?;
        Some(((first % self.width) as i64, (first / self.width) as i64))
    }

    fn area(&self) -> usize {
        self.inside.iter().filter(|inside| **inside).count()
    }

    fn with(&self, inside: Vec<bool>) -> Self {
        Self { inside, ..*self }
    }

    /// Indices of the pixels beside one (4 neighbours).
    fn beside(&self, p: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y, width, height) = (p % self.width, p / self.width, self.width, self.height);
        let left = (x > 0).then(|| p - 1);
        let right = (x + 1 < width).then_some(p + 1);
        let up = (y > 0).then(|| p - width);
        let down = (y + 1 < height).then_some(p + width);
        [left, right, up, down].into_iter().flatten()
    }

    /// The pixels equal to `seed` and connected with it, added to `seen`.
    fn flood(&self, seed: usize, seen: &mut [bool]) -> Vec<usize> {
        let mut found = vec![seed];
        seen[seed] = true;
        let mut next = 0;
        while let Some(p) = found.get(next).copied() {
            next += 1;
            for q in self.beside(p) {
                if !seen[q] && self.inside[q] == self.inside[seed] {
                    seen[q] = true;
                    found.push(q);
                }
            }
        }
        found
    }

    /// The largest connected part, of several the first.
    fn largest(&self) -> Self {
        let parts = pieces(self.inside.len(), |p| self.beside(p), |p| self.inside[p]);
        // The last of equal ones is the maximum: the first, backwards.
        self.with_pixels(&parts.into_iter().rev().max_by_key(Vec::len).unwrap_or_default())
    }

    fn with_pixels(&self, pixels: &[usize]) -> Self {
        let mut inside = vec![false; self.inside.len()];
        for p in pixels {
            inside[*p] = true;
        }
        self.with(inside)
    }

    /// The region with its holes: everything that the background at the picture's rim does not reach.
    fn filled(&self) -> Self {
        let mut outside = vec![false; self.inside.len()];
        for p in 0..self.inside.len() {
            let (x, y) = (p % self.width, p / self.width);
            let rim = x == 0 || y == 0 || x + 1 == self.width || y + 1 == self.height;
            if rim && !self.inside[p] && !outside[p] {
                self.flood(p, &mut outside);
            }
        }
        self.with(outside.into_iter().map(|outside| !outside).collect())
    }

    /// The pixels of the petiole: the longest of the parts that a morphological opening takes away, if it is long
    /// enough and at the given end.
    fn petiole(&self, ends: Ends) -> Option<Self> {
        // Beyond the picture there is no leaf, hence the rim.
        let depth = distances(self.width, self.height, |p| !self.inside[p], true);
        let radius = PETIOLE_SHARE * depth.iter().copied().fold(0.0, f64::max);
        let reach = distances(self.width, self.height, |p| depth[p] > radius, false);
        let residue = self.with((0..self.inside.len()).map(|p| self.inside[p] && reach[p] > radius).collect());
        let along = |p: usize| ends.along((p % self.width) as f64, (p / self.width) as f64);
        let inside = (0..self.inside.len()).filter(|p| self.inside[*p]);
        let (low, high) = inside.map(along).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        let limit = low + BASE_SHARE * (high - low);
        let candidates = (0..self.inside.len()).filter(|p| residue.inside[*p] && along(*p) <= limit);
        let end = candidates.max_by(|a, b| reach[*a].total_cmp(&reach[*b]))?;
        let long = reach[end] > (1.0 + PETIOLE_LENGTH) * radius;
        long.then(|| self.with_pixels(&residue.flood(end, &mut vec![false; self.inside.len()])))
    }

    /// What is left without `petiole`, and the middle of where it was cut.
    fn without(&self, petiole: &Self) -> (Self, Option<DVec2>) {
        let rest = (0..self.inside.len()).map(|p| self.inside[p] && !petiole.inside[p]).collect();
        let blade = self.with(rest).largest();
        let cut = (0..self.inside.len()).filter(|p| blade.inside[*p] && self.beside(*p).any(|q| petiole.inside[q]));
        let (sum, count) = cut.fold((DVec2::ZERO, 0.0), |(sum, count), p| {
            let middle = DVec2::new((p % self.width) as f64 + 0.5, (p / self.width) as f64 + 0.5);
            (sum + middle, count + 1.0)
        });
        (blade, (count > 0.0).then(|| sum / count))
    }
}
