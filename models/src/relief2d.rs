use demeter_frame::Rgb;
use image::imageops::FilterType;
use ndarray::{Axis, s};

use crate::organ2d::{signature, working_size};
use crate::pixels::{dimensions, planes, resized, stretched};
use crate::{DepthMap, Model, ModelError};

/// The long side of its working size, pixels: what taught it was about this large, and on rendered pictures held out its
/// depth is at its best there (docs/training.md).
const LONG_SIDE: u32 = 256;

/// Our network for depth alone: the plane of the ground or of a wall, and by how much nearer what stands before it is,
/// trained by models/training/train_relief2d.py.
///
/// The graph takes `image` f32 `[n, 3, h, w]`, RGB in 0..=1 with sides that are multiples of 16, and gives `depth`
/// `[n, 1, h, w]`, log depth up to a constant.
#[derive(Debug)]
pub struct Relief2d {
    model: Model,
}

impl Relief2d {
    /// Takes the model for this layout.
    ///
    /// # Errors
    /// [`ModelError::Ports`] when it has others.
    pub(crate) fn new(model: Model) -> Result<Self, ModelError> {
        model.needs(&signature(&[("image", 3)]), &signature(&[("depth", 1)]))?;
        Ok(Self { model })
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
        let (w, h) = working_size(size.0, size.1, LONG_SIDE);
        let picture = planes(&resized(image, (w, h), FilterType::Triangle), |_, value| value / 255.0);
        let outputs = self.model.run(&[("image", picture.insert_axis(Axis(0)).into())])?;
        let depth = outputs.f32("depth", [1, 1, h.into(), w.into()])?;
        Ok(DepthMap::RelativeLog(stretched(depth.slice(s![0, 0, .., ..]), size)))
    }
}
