//! Organ instances of a picture from classes and boundary distance.

use std::collections::{BTreeSet, VecDeque};

use demeter_frame::{Instances, Semantic};
use image::ImageBuffer;

use super::View;
use super::lift::MAX_SLOPE;
use crate::model::OrganKind;

/// Truncated inverse distances below which seeds are looked for, one after the other: what is far from every other
/// organ first, then the thin and the crowded. t saturates at 1 within δ = 1 % of the picture's diagonal, so 0.8 is 1.25
/// δ and the last is everything (ours to tune, reconstruction.md "Points to organs").
const LEVELS: [f32; 2] = [0.8, f32::INFINITY];
/// A patch of main stem that touches one leaf and nothing else is that leaf's tip, hanging like a stem, when it has less
/// than this share of the largest patch's pixels (a guess; plants in one picture are of a size).
const TIP_SHARE: f64 = 0.5;
/// Depth jumps from one organ to the next are told from the network's blur by this many times its median step.
const BLUR_STEPS: f32 = 4.0;
/// The smallest seed at 640 x 480, pixels: smaller ones are specks (a guess).
const MIN_SEED: f64 = 10.0;
/// Most instances in one picture; the smallest go first. A bound for later stages, far above any plant row in view.
const MAX_INSTANCES: usize = 1024;

/// One organ instance in the picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// Its id in the raster, 1 and up, in the order of first pixels.
    pub id: u16,
    /// What it is.
    pub kind: OrganKind,
    /// How many pixels it has.
    pub pixels: usize,
    /// Whether it touches the picture's border.
    pub touches_border: bool,
    /// First and last column and row: `[x0, y0, x1, y1]`, inclusive.
    pub bounds: [u32; 4],
}

/// Divides the organ pixels of a view into instances.
///
/// Level by level, seeds grow into the pixels of their class that they reach, and connected pixels that no seed reaches
/// become seeds themselves: a watershed of the boundary distance inside each class.
#[must_use]
pub fn instances(view: &View<'_>) -> (Instances, Vec<Region>) {
    let class: Vec<u8> = view.semantic.as_raw().iter().map(|&c| if kind(c).is_some() { c } else { 0 }).collect();
    let grid = Grid::of(view, &class);
    let min_seed = view.pixels(MIN_SEED);

    let (mut label, mut last) = (vec![0; class.len()], 0);
    for level in LEVELS {
        // Main stems do not cross, but leaves all along would cut them: they need no boundary.
        let is_core = |c: u8, t: f32| c == MAIN || t < level || level == f32::INFINITY;
        let core: Vec<u8> =
            class.iter().zip(view.dist.as_raw()).map(|(&c, &t)| if is_core(c, t) { c } else { 0 }).collect();
        grid.grow(&core, &mut label);
        let free: Vec<u8> = core.iter().zip(&label).map(|(&c, &l)| if l == 0 { c } else { 0 }).collect();
        last = grid.components(&free, min_seed, &mut label, last);
    }
    let class = grid.tips_to_leaves(class, &mut label, last);
    grid.table(&class, &label, last)
}

/// The instances that a network divided already: `ids` of the view's size, 0 for none, each of one class. They are
/// numbered anew; pixels without a class belong to none.
#[must_use]
pub fn divided(view: &View<'_>, ids: &Instances) -> (Instances, Vec<Region>) {
    let class = view.semantic.as_raw();
    let label: Vec<u32> = ids.iter().map(|&id| id.into()).collect();
    let count = label.iter().copied().max().unwrap_or(0);
    Grid::of(view, class).table(class, &label, count)
}

const LEAF: u8 = Semantic::Leaf as u8;
const STEM: u8 = Semantic::Stem as u8;
const MAIN: u8 = Semantic::MainStem as u8;

fn kind(class: u8) -> Option<OrganKind> {
    match class {
        LEAF => Some(OrganKind::Leaf),
        STEM => Some(OrganKind::Stem),
        MAIN => Some(OrganKind::MainStem),
        _ => None,
    }
}

struct Grid<'a> {
    width: usize,
    height: usize,
    log_depth: &'a [f32],
    /// Largest change of log depth from one pixel to the next on one organ.
    jump: f32,
}

impl<'a> Grid<'a> {
    fn of(view: &View<'a>, class: &[u8]) -> Self {
        let (width, log_depth) = (view.intrinsics.width as usize, view.log_depth.as_raw());
        let mut steps: Vec<f32> = (1..class.len())
            .filter(|&p| p % width > 0 && class[p] != 0 && class[p - 1] != 0)
            .map(|p| (log_depth[p] - log_depth[p - 1]).abs())
            .filter(|step| step.is_finite())
            .collect();
        let middle = steps.len() / 2;
        let median = if steps.is_empty() { 0.0 } else { *steps.select_nth_unstable_by(middle, f32::total_cmp).1 };
        let slope = (MAX_SLOPE / view.intrinsics.fx.min(view.intrinsics.fy)) as f32;
        let height = view.intrinsics.height as usize;
        Self { width, height, log_depth, jump: slope.max(BLUR_STEPS * median) }
    }

    /// The up to eight neighbours of pixel `p`: stems one pixel wide run diagonally.
    fn around(&self, p: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y, width, height) = (p % self.width, p / self.width, self.width, self.height);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |j| (x.saturating_sub(1)..(x + 2).min(width)).map(move |i| j * width + i))
            .filter(move |&q| q != p)
    }

    /// Those that are not before or behind it.
    fn neighbours(&self, p: usize) -> impl Iterator<Item = usize> + use<'_, 'a> {
        let (log_depth, jump) = (self.log_depth, self.jump);
        let apart = move |q: usize| (log_depth[q] - log_depth[p]).abs() > jump;
        self.around(p).filter(move |&q| !apart(q))
    }

    /// Labels connected pixels of equal, non-zero `key`, at least `min` of them, from `last` + 1 on; gives the last.
    fn components(&self, key: &[u8], min: usize, label: &mut [u32], mut last: u32) -> u32 {
        let mut seen = vec![false; key.len()];
        for start in 0..key.len() {
            if key[start] == 0 || seen[start] {
                continue;
            }
            seen[start] = true;
            let mut patch = vec![start];
            let mut next = 0;
            while next < patch.len() {
                for q in self.neighbours(patch[next]) {
                    if key[q] == key[start] && !seen[q] {
                        seen[q] = true;
                        patch.push(q);
                    }
                }
                next += 1;
            }
            if patch.len() >= min {
                last += 1;
                for p in patch {
                    label[p] = last;
                }
            }
        }
        last
    }

    /// Gives patches of main stem that are the tips of leaves to those leaves; gives the classes after that.
    fn tips_to_leaves(&self, mut class: Vec<u8>, label: &mut [u32], last: u32) -> Vec<u8> {
        let count = last as usize + 1;
        let (mut sizes, mut kind_of) = (vec![0usize; count], vec![0u8; count]);
        let mut touched: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); count];
        for (p, &l) in label.iter().enumerate().filter(|&(_, &l)| l > 0) {
            sizes[l as usize] += 1;
            kind_of[l as usize] = class[p];
            if class[p] == MAIN {
                touched[l as usize].extend(self.around(p).map(|q| label[q]).filter(|&m| m != 0 && m != l));
            }
        }
        let largest = (0..count).filter(|&l| kind_of[l] == MAIN).map(|l| sizes[l]).max().unwrap_or(0) as f64;
        let leaf_of = |l: usize| match Vec::from_iter(&touched[l]).as_slice() {
            &[&only] if (sizes[l] as f64) < TIP_SHARE * largest && kind_of[only as usize] == LEAF => Some(only),
            _ => None,
        };
        let goes_to: Vec<Option<u32>> =
            (0..count).map(|l| if kind_of[l] == MAIN { leaf_of(l) } else { None }).collect();
        for (c, l) in class.iter_mut().zip(label) {
            if let Some(leaf) = goes_to[*l as usize] {
                (*c, *l) = (LEAF, leaf);
            }
        }
        class
    }

    /// Gives every pixel that a label reaches inside its class the nearest one (breadth first, so in steps).
    fn grow(&self, class: &[u8], label: &mut [u32]) {
        let mut queue: VecDeque<usize> = (0..label.len()).filter(|&p| label[p] != 0).collect();
        while let Some(p) = queue.pop_front() {
            for q in self.neighbours(p) {
                if label[q] == 0 && class[q] == class[p] {
                    label[q] = label[p];
                    queue.push_back(q);
                }
            }
        }
    }

    /// The raster and table of labels 1..=`count`, numbered anew in the order of first pixels.
    fn table(&self, class: &[u8], label: &[u32], count: u32) -> (Instances, Vec<Region>) {
        let mut sizes = vec![0usize; count as usize + 1];
        for &l in label {
            sizes[l as usize] += 1;
        }
        let mut kept: Vec<u32> = (1..=count).collect();
        kept.sort_by_key(|&l| (std::cmp::Reverse(sizes[l as usize]), l));
        kept.truncate(MAX_INSTANCES);
        let mut is_kept = vec![false; count as usize + 1];
        for l in kept {
            is_kept[l as usize] = true;
        }

        let mut id = vec![0u16; count as usize + 1];
        let mut regions: Vec<Region> = Vec::new();
        let mut raster = ImageBuffer::new(self.width as u32, self.height as u32);
        for ((p, &l), pixel) in label.iter().enumerate().zip(raster.iter_mut()) {
            let (Some(kind), true) = (kind(class[p]), is_kept[l as usize]) else { continue };
            let (x, y) = ((p % self.width) as u32, (p / self.width) as u32);
            if id[l as usize] == 0 {
                id[l as usize] = regions.len() as u16 + 1;
                let (id, bounds) = (id[l as usize], [x, y, x, y]);
                regions.push(Region { id, kind, pixels: 0, touches_border: false, bounds });
            }
            *pixel = id[l as usize];
            let region = &mut regions[usize::from(id[l as usize]) - 1];
            region.pixels += 1;
            let [x0, y0, x1, y1] = region.bounds;
            region.bounds = [x0.min(x), y0.min(y), x1.max(x), y1.max(y)];
            region.touches_border |= x == 0 || y == 0 || x as usize == self.width - 1 || y as usize == self.height - 1;
        }
        (raster, regions)
    }
}
