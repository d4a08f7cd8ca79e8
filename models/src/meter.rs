use demeter_frame::Rgb;
use image::imageops::FilterType;
use ndarray::{Axis, s};

use crate::pixels::{dimensions, planes, resized, stretched};
use crate::{DepthMap, Model, ModelError};

/// The one size it takes, width and height in pixels.
const SIZE: (u32, u32) = (256, 192);
/// Metres in its unit, centimetres (inferred from what it says of rooms: spec/models.md).
const UNIT: f32 = 0.01;

/// METER (Papa et al. 2023), metric depth of rooms: [1, 3, 192, 256], RGB in 0..=1, to [1, 1, 48, 64] in centimetres.
#[derive(Debug)]
pub struct Meter {
    model: Model,
}

impl Meter {
    pub(crate) fn new(model: Model) -> Self {
        Self { model }
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Depth of every pixel, metres.
    ///
    /// # Errors
    /// [`ModelError`]: an empty picture, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<DepthMap, ModelError> {
        let size = dimensions(image)?;
        let picture = planes(&resized(image, SIZE, FilterType::Triangle), |_, value| value / 255.0);
        let outputs = self.model.run(&[("image", picture.insert_axis(Axis(0)).into())])?;
        let metres = outputs.f32("depth", [1, 1, 48, 64])?.mapv(|centimetres| UNIT * centimetres);
        Ok(DepthMap::Metric(stretched(metres.slice(s![0, 0, .., ..]), size)))
    }
}
