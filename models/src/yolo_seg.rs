use demeter_frame::Rgb;
use image::imageops::{FilterType, replace};
use ndarray::{Array1, Array2, ArrayView2, ArrayView3, Axis, s};

use crate::instance::{Bounds, Instance, MAX_INSTANCES, organ, surest};
use crate::pixels::{bilinear, dimensions, fixed_sides, planes, resized};
use crate::{Layout, Model, ModelError};

/// The side of its pictures where the graph leaves it open, pixels: its own default.
const SIDE: u32 = 640;
/// What surrounds a picture that is not square: its own grey.
const PADDING: u8 = 114;
/// Coefficients of a mask, one a prototype.
const PROTOTYPES: usize = 32;
/// The least score, and the overlap (IoU) above which the less sure of two boxes of one class goes: its own defaults.
const MIN_SCORE: f32 = 0.25;
const MAX_OVERLAP: f32 = 0.7;

/// YOLOv8-seg and YOLO11-seg (ultralytics): [1, 3, 640, 640], RGB in 0..=1, in a grey frame, to boxes with scores and
/// 32 coefficients, and 32 prototypes whose sums with these are the masks' logits.
///
/// As it is: [1, 4 + classes + 32, places] with centre, width and height. With suppression in the graph: [1, n, 38] with
/// corners, score and class.
#[derive(Debug)]
pub struct YoloSeg {
    model: Model,
    /// Width and height of its pictures.
    size: (u32, u32),
}

/// Where a picture lies in the network's.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Letterbox {
    scale: f32,
    left: u32,
    top: u32,
    inner: (u32, u32),
}

/// One thing found, its box in the network's picture.
struct Found {
    bounds: Bounds,
    score: f32,
    class: i64,
    coefficients: Array1<f32>,
}

impl YoloSeg {
    pub(crate) fn new(model: Model) -> Result<Self, ModelError> {
        let [height, width] = fixed_sides(model.manifest(), 1)?;
        let size = (width.unwrap_or(SIDE), height.unwrap_or(SIDE));
        Ok(Self { model, size })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The organs of a picture, the surest first.
    ///
    /// # Errors
    /// [`ModelError`]: an empty picture, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<Vec<Instance>, ModelError> {
        let size = dimensions(image)?;
        let letterbox = Letterbox::of(size, self.size);
        let mut framed = Rgb::from_pixel(self.size.0, self.size.1, image::Rgb([PADDING; 3]));
        let inner = resized(image, letterbox.inner, FilterType::Triangle);
        replace(&mut framed, &*inner, letterbox.left.into(), letterbox.top.into());
        let picture = planes(&framed, |_, value| value / 255.0).insert_axis(Axis(0));
        let outputs = self.model.run(&[("images", picture.into())])?;
        let prototypes = outputs.f32("output1", [1, PROTOTYPES as i64, -1, -1])?;
        if prototypes.is_empty() {
            return Err(self.wrong("output1", vec![1, PROTOTYPES as i64, -1, -1], prototypes.shape()));
        }
        let prototypes = prototypes.index_axis(Axis(0), 0);
        let found = if self.model.manifest().layout == Layout::YoloSegNms {
            suppressed(outputs.f32("output0", [1, -1, 6 + PROTOTYPES as i64])?.index_axis(Axis(0), 0))
        } else {
            let places = outputs.f32("output0", [1, -1, -1])?;
            if places.len_of(Axis(1)) <= 4 + PROTOTYPES {
                return Err(self.wrong("output0", vec![1, 5 + PROTOTYPES as i64, -1], places.shape()));
            }
            raw(places.index_axis(Axis(0), 0))
        };
        let classes = &self.model.manifest().classes;
        let instance = |found: Found| {
            let organ = organ(classes, found.class);
            let logits = logits(&found, prototypes);
            // From the picture to the prototypes.
            let (sx, sy) = (logits.ncols() as f32 / self.size.0 as f32, logits.nrows() as f32 / self.size.1 as f32);
            let is = |x: f32, y: f32| {
                let [u, v] = letterbox.forth(x, y);
                bilinear(logits.view(), u * sx, v * sy) > 0.0
            };
            Instance::inside(letterbox.back(found.bounds), size, organ, found.score, is)
        };
        Ok(found.into_iter().filter_map(instance).take(MAX_INSTANCES).collect())
    }

    fn wrong(&self, output: &str, expected: Vec<i64>, found: &[usize]) -> ModelError {
        let name = self.model.manifest().name.clone();
        ModelError::Shape { name, output: output.into(), expected, found: found.into() }
    }
}

impl Letterbox {
    /// As large as it may be, in the middle; half pixels go right and down, as in its own code.
    fn of((width, height): (u32, u32), (w, h): (u32, u32)) -> Self {
        let scale = (w as f32 / width as f32).min(h as f32 / height as f32);
        let side = |pixels: u32, most: u32| ((pixels as f32 * scale).round() as u32).clamp(1, most);
        let inner = (side(width, w), side(height, h));
        Self { scale, left: (w - inner.0) / 2, top: (h - inner.1) / 2, inner }
    }

    fn forth(&self, x: f32, y: f32) -> [f32; 2] {
        [x * self.scale + self.left as f32, y * self.scale + self.top as f32]
    }

    fn back(&self, [x0, y0, x1, y1]: Bounds) -> Bounds {
        let (x, y) = (|u: f32| (u - self.left as f32) / self.scale, |v: f32| (v - self.top as f32) / self.scale);
        [x(x0), y(y0), x(x1), y(y1)]
    }
}

/// What rows of corners, score, class and coefficients say, the surest first.
fn suppressed(rows: ArrayView2<'_, f32>) -> Vec<Found> {
    let found = |i: usize| {
        let row = rows.row(i);
        Found {
            bounds: [row[0], row[1], row[2], row[3]],
            score: row[4],
            class: row[5].round() as i64,
            coefficients: row.slice(s![6..]).to_owned(),
        }
    };
    surest(rows.column(4), MIN_SCORE).into_iter().map(found).collect()
}

/// What columns of centre, size, scores and coefficients say: of boxes of one class that overlap, the surest.
fn raw(columns: ArrayView2<'_, f32>) -> Vec<Found> {
    let classes = columns.nrows() - 4 - PROTOTYPES;
    let scores = columns.slice(s![4..4 + classes, ..]);
    let best = scores.fold_axis(Axis(0), f32::NEG_INFINITY, |&a, &b| a.max(b));
    let mut kept: Vec<Found> = Vec::new();
    for i in surest(&best, MIN_SCORE) {
        let column = columns.column(i);
        let [x, y, w, h] = [column[0], column[1], column[2], column[3]];
        let bounds = [x - w / 2.0, y - h / 2.0, x + w / 2.0, y + h / 2.0];
        let class = scores.column(i).iter().position(|&score| score == best[i]).unwrap_or(0) as i64;
        if kept.iter().all(|other| other.class != class || overlap(other.bounds, bounds) <= MAX_OVERLAP) {
            let coefficients = column.slice(s![4 + classes..]).to_owned();
            kept.push(Found { bounds, score: best[i], class, coefficients });
        }
        if kept.len() == MAX_INSTANCES {
            break;
        }
    }
    kept
}

/// Intersection over union.
fn overlap(a: Bounds, b: Bounds) -> f32 {
    let area = |[x0, y0, x1, y1]: Bounds| (x1 - x0).max(0.0) * (y1 - y0).max(0.0);
    let both = area([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])]);
    let either = area(a) + area(b) - both;
    if either > 0.0 { both / either } else { 0.0 }
}

/// The logits of a thing's mask: the prototypes' sum, each times its coefficient.
fn logits(found: &Found, prototypes: ArrayView3<'_, f32>) -> Array2<f32> {
    let mut sum = Array2::zeros((prototypes.len_of(Axis(1)), prototypes.len_of(Axis(2))));
    for (&coefficient, prototype) in found.coefficients.iter().zip(prototypes.outer_iter()) {
        sum.scaled_add(coefficient, &prototype);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letterboxes_are_centred_and_lead_back() {
        let box_ = Letterbox::of((320, 160), (640, 640));
        assert_eq!(box_, Letterbox { scale: 2.0, left: 0, top: 160, inner: (640, 320) });
        assert_eq!(box_.forth(10.0, 20.0), [20.0, 200.0]);
        assert_eq!(box_.back([20.0, 200.0, 640.0, 480.0]), [10.0, 20.0, 320.0, 160.0]);
        assert_eq!(Letterbox::of((16_000, 1), (640, 640)).inner, (640, 1));
    }

    #[test]
    fn overlaps_are_shares_of_the_union() {
        assert_eq!(overlap([0.0, 0.0, 2.0, 2.0], [1.0, 0.0, 3.0, 2.0]), 1.0 / 3.0);
        assert_eq!(overlap([0.0, 0.0, 1.0, 1.0], [2.0, 2.0, 3.0, 3.0]), 0.0);
        assert_eq!(overlap([1.0; 4], [1.0; 4]), 0.0);
    }
}
