use std::num::NonZeroUsize;
use std::path::Path;

use demeter_frame::{Mask, Rgb};
use image::imageops::FilterType;
use ndarray::{Axis, s};

use crate::pixels::{dimensions, imagenet, planes, resized, stretched};
use crate::{Layout, Model, ModelError, Runtime};

/// The side it takes, pixels.
const SIDE: u32 = 320;
/// A map whose values differ by less shows nothing that stands out (a guess: a sigmoid's rounding).
const FLAT: f32 = 1e-4;

/// U²-Net and u2netp (Qin et al. 2020), what stands out in a picture: [1, 3, 320, 320], RGB as a share of the
/// picture's largest value and then as in ImageNet's statistics, to [1, 1, 320, 320] in 0..=1.
#[derive(Debug)]
pub struct U2net {
    model: Model,
}

impl U2net {
    /// Opens the network that the manifest at `path` describes, on `threads` threads.
    ///
    /// # Errors
    /// Those of [`Model::open`], and [`ModelError::Ports`] when it is another network.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        Ok(Self { model: Model::open_as(runtime, path, threads, &[Layout::U2net])? })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// How much each pixel stands out, from 0 for the least to 1 for the most in this picture, as its authors show it;
    /// 0 everywhere when nothing does.
    ///
    /// # Errors
    /// [`ModelError`]: an empty picture, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<Mask, ModelError> {
        let size = dimensions(image)?;
        let small = resized(image, (SIDE, SIDE), FilterType::Lanczos3);
        let most = small.iter().copied().max().map_or(1.0, |most| f32::from(most.max(1)));
        let picture = planes(&small, |channel, value| imagenet(channel, value / most));
        let outputs = self.model.run(&[("input.1", picture.insert_axis(Axis(0)).into())])?;
        let mask = outputs.f32("mask", [1, 1, SIDE.into(), SIDE.into()])?;
        let (low, high) = mask.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
        let range = high - low;
        let mask = mask.mapv(|value| if range > FLAT { (value - low) / range } else { 0.0 });
        Ok(stretched(mask.slice(s![0, 0, .., ..]), size))
    }
}
