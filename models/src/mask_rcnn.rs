use demeter_frame::Rgb;
use image::imageops::FilterType;
use ndarray::{Array2, ArrayView2, s};

use crate::instance::{Bounds, Instance, MAX_INSTANCES, organ, surest};
use crate::pixels::{bilinear, dimensions, planes, resized};
use crate::{Layout, Model, ModelError};

/// The least score of an organ: what both projects' examples show.
const MIN_SCORE: f32 = 0.5;
/// Where a mask begins, in both projects.
const MASK: f32 = 0.5;
/// detectron2's pictures, pixels: the short side, unless the long one would be longer than that.
const DETECTRON2_SIDES: (f64, f64) = (800.0, 1333.0);

/// Mask R-CNN (He et al. 2017) as torchvision or detectron2 export it.
///
/// torchvision: [3, h, w], RGB in 0..=1, resized inside, to boxes and masks of the picture. detectron2: [3, h, w],
/// BGR in 0..=255, resized by the caller, to boxes of that picture and masks of 28 x 28 to be put into them.
#[derive(Debug)]
pub struct MaskRcnn {
    model: Model,
}

impl MaskRcnn {
    pub(crate) fn new(model: Model) -> Self {
        Self { model }
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
        if self.model.manifest().layout == Layout::Detectron2MaskRcnn {
            self.detectron2(image, size)
        } else {
            self.torchvision(image, size)
        }
    }

    fn torchvision(&mut self, image: &Rgb, size: (u32, u32)) -> Result<Vec<Instance>, ModelError> {
        let (width, height) = size;
        let picture = planes(image, |_, value| value / 255.0);
        let outputs = self.model.run(&[("image", picture.into())])?;
        let scores = outputs.f32("scores", [-1])?;
        let count = scores.len() as i64;
        let boxes = outputs.f32("boxes", [count, 4])?;
        let labels = outputs.i64("labels", [count])?;
        let masks = outputs.f32("masks", [count, 1, height.into(), width.into()])?;
        let classes = &self.model.manifest().classes;
        let instance = |i: usize| {
            let mask = masks.slice(s![i, 0, .., ..]);
            let is = |x: f32, y: f32| mask[[y as usize, x as usize]] >= MASK;
            // A mask may reach half a pixel beyond its box.
            let [x0, y0, x1, y1] = corners(boxes.row(i).as_slice()?)?;
            Instance::inside([x0 - 1.0, y0 - 1.0, x1 + 1.0, y1 + 1.0], size, organ(classes, labels[i]), scores[i], is)
        };
        Ok(surest(scores.iter(), MIN_SCORE).into_iter().filter_map(instance).take(MAX_INSTANCES).collect())
    }

    fn detectron2(&mut self, image: &Rgb, size: (u32, u32)) -> Result<Vec<Instance>, ModelError> {
        let (width, height) = size;
        let (short, long) = (f64::from(width.min(height)), f64::from(width.max(height)));
        let scale = (DETECTRON2_SIDES.0 / short).min(DETECTRON2_SIDES.1 / long);
        let side = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).max(1);
        let working = (side(width), side(height));
        let mut picture = planes(&resized(image, working, FilterType::Triangle), |_, value| value);
        picture.invert_axis(ndarray::Axis(0));
        let outputs = self.model.run(&[("image", picture.into())])?;
        let scores = outputs.f32("scores", [-1])?;
        let count = scores.len() as i64;
        let boxes = outputs.f32("pred_boxes", [count, 4])?;
        let labels = outputs.i64("pred_classes", [count])?;
        let masks = outputs.f32("pred_masks", [count, 1, 28, 28])?;
        // What the boxes are in: the working picture, height first.
        let frame = outputs.i64("image_size", [2])?.mapv(|side| side.max(1) as f32);
        let (sx, sy) = (width as f32 / frame[1], height as f32 / frame[0]);
        let classes = &self.model.manifest().classes;
        let instance = |i: usize| {
            let [x0, y0, x1, y1] = corners(boxes.row(i).as_slice()?)?;
            let bounds = [x0 * sx, y0 * sy, x1 * sx, y1 * sy];
            let is = pasted(masks.slice(s![i, 0, .., ..]), bounds);
            Instance::inside(bounds, size, organ(classes, labels[i]), scores[i], is)
        };
        Ok(surest(scores.iter(), MIN_SCORE).into_iter().filter_map(instance).take(MAX_INSTANCES).collect())
    }
}

fn corners(row: &[f32]) -> Option<Bounds> {
    row.try_into().ok()
}

/// Whether a mask stretched over a box covers a place: bilinear, with nothing around it, as detectron2 pastes.
fn pasted(mask: ArrayView2<'_, f32>, [x0, y0, x1, y1]: Bounds) -> impl Fn(f32, f32) -> bool {
    let (h, w) = mask.dim();
    let mut framed = Array2::zeros((h + 2, w + 2));
    framed.slice_mut(s![1..=h, 1..=w]).assign(&mask);
    move |x, y| {
        let (u, v) = ((x - x0) / (x1 - x0) * w as f32, (y - y0) / (y1 - y0) * h as f32);
        bilinear(framed.view(), u + 1.0, v + 1.0) >= MASK
    }
}
