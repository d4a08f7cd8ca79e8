use demeter_frame::Rgb;
use image::imageops::FilterType;
use ndarray::Axis;

use crate::pixels::{dimensions, fixed_sides, imagenet, planes, resized, stretched};
use crate::{DepthMap, Layout, Model, ModelError};

/// A patch of its vision transformer, pixels: sides are multiples of it.
const PATCH: u32 = 14;
/// The short side it was trained at, pixels, which its authors keep for any picture.
const SHORT_SIDE: u32 = 518;
/// The longest side, pixels: pictures longer than two to one are squeezed, so that memory is bounded (a guess).
const LONG_SIDE: u32 = 1036;

/// Depth Anything V2 (Yang et al. 2024): [1, 3, h, w], RGB as in ImageNet's statistics, sides multiples of 14, to
/// [1, h, w], inverse depth up to scale and shift or, of the metric kind, metres.
#[derive(Debug)]
pub struct DepthAnything {
    model: Model,
    /// Height and width where the graph fixes them.
    fixed: [Option<u32>; 2],
}

impl DepthAnything {
    /// Takes the model for this layout.
    ///
    /// # Errors
    /// [`ModelError::Ports`] when the graph fixes a side that is no multiple of 14 or beyond any use.
    pub(crate) fn new(model: Model) -> Result<Self, ModelError> {
        let fixed = fixed_sides(model.manifest(), PATCH.into())?;
        Ok(Self { model, fixed })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Depth of every pixel.
    ///
    /// # Errors
    /// [`ModelError`]: an empty picture, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<DepthMap, ModelError> {
        let size = dimensions(image)?;
        let [fixed_height, fixed_width] = self.fixed;
        let (w, h) = working_size(size);
        let (w, h) = (fixed_width.unwrap_or(w), fixed_height.unwrap_or(h));
        let picture = planes(&resized(image, (w, h), FilterType::CatmullRom), |c, v| imagenet(c, v / 255.0));
        let outputs = self.model.run(&[("pixel_values", picture.insert_axis(Axis(0)).into())])?;
        let depth = outputs.f32("predicted_depth", [1, h.into(), w.into()])?;
        let depth = stretched(depth.index_axis(Axis(0), 0), size);
        let metric = self.model.manifest().layout == Layout::DepthAnythingMetric;
        Ok(if metric { DepthMap::Metric(depth) } else { DepthMap::RelativeInverse(depth) })
    }
}

/// The size of its authors: the short side at 518 pixels, sides the nearest multiples of 14.
fn working_size((width, height): (u32, u32)) -> (u32, u32) {
    let scale = f64::from(SHORT_SIDE) / f64::from(width.min(height));
    let side = |pixels: u32| {
        let patches = (f64::from(pixels) * scale / f64::from(PATCH)).round() as u32;
        patches.clamp(SHORT_SIDE / PATCH, LONG_SIDE / PATCH) * PATCH
    };
    (side(width), side(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn working_sizes_are_the_authors_and_bounded() {
        for (size, expected) in [
            ((640, 480), (686, 518)),
            ((480, 640), (518, 686)),
            ((518, 518), (518, 518)),
            ((1920, 1080), (924, 518)),
            ((1, 1), (518, 518)),
            ((16_384, 1), (1036, 518)),
        ] {
            assert_eq!(working_size(size), expected, "{size:?}");
        }
    }
}
