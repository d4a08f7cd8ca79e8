use std::num::NonZeroUsize;
use std::path::Path;

use demeter_frame::{Depth, Mask, Rgb, Semantic};
use image::imageops::FilterType;
use image::{GrayImage, ImageBuffer, Luma};
use ndarray::{ArrayView2, Axis, s};

use crate::pixels::{dimensions, planes, resized};
use crate::{CameraGuess, Layout, Model, ModelError, Port, Runtime};

/// The network halves its input four times, so sides are multiples of this many pixels.
const MULTIPLE: u32 = 16;
/// Time and memory grow with the square of the side; 2048 is beyond any use we know (a guess).
const MAX_LONG_SIDE: u32 = 2048;

/// What the network sees in one image, at its working size.
#[derive(Clone, Debug, PartialEq)]
pub struct OrganMaps {
    /// Probability of each class, in the order of [`Semantic::ALL`]; they sum to 1 at every pixel.
    pub probabilities: [Mask; 4],
    /// Truncated inverse distance to the nearest pixel of another organ, δ / max(d, δ) with δ = 3.6 pixels of these maps
    /// (1 % of the diagonal of the 256-pixel pictures that taught it); it means something on organs only.
    pub dist: Mask,
    /// Natural logarithm of depth along the camera's axis, up to one additive constant for the image.
    pub log_depth: Depth,
    /// Pixels of the original image per pixel of these maps, along x and y: continuous coordinates are multiplied.
    pub scale: [f64; 2],
    /// The camera, as the picture tells it; good for the original as for the maps.
    pub camera: CameraGuess,
}

impl OrganMaps {
    /// The pixel of the maps that shows pixel (x, y) of the original image.
    #[must_use]
    pub fn at(&self, x: u32, y: u32) -> (u32, u32) {
        let (width, height) = self.dist.dimensions();
        let at = |value: u32, scale: f64, side: u32| (((f64::from(value) + 0.5) / scale) as u32).min(side - 1);
        (at(x, self.scale[0], width), at(y, self.scale[1], height))
    }

    /// The probability that each pixel shows a plant.
    #[must_use]
    pub fn plants(&self) -> Mask {
        let [background, ..] = &self.probabilities;
        let mut plants = background.clone();
        plants.iter_mut().for_each(|p| *p = 1.0 - *p);
        plants
    }

    /// The likeliest class of each pixel, as the number of its [`Semantic`].
    #[must_use]
    pub fn semantic(&self) -> GrayImage {
        let (width, height) = self.dist.dimensions();
        GrayImage::from_fn(width, height, |x, y| {
            let p = self.probabilities.each_ref().map(|class| class.get_pixel(x, y).0[0]);
            let best = Semantic::ALL.into_iter().max_by(|&a, &b| p[a as usize].total_cmp(&p[b as usize]));
            Luma([best.unwrap_or(Semantic::Background) as u8])
        })
    }
}

/// Our network for organs and depth: a residual U-Net trained by models/training/train_organ2d.py.
///
/// The graph takes `image` f32 `[n, 3, h, w]`, RGB in 0..=1 with sides that are multiples of 16, and gives the logits
/// `sem` `[n, 4, h, w]`, `dist` `[n, 1, h, w]` in 0..=1, `depth` `[n, 1, h, w]`, log depth up to a constant
/// (spec/models.md, "Our networks"), and `camera` `[n, 6]`, see [`CameraGuess`].
#[derive(Debug)]
pub struct Organ2d {
    model: Model,
    long_side: u32,
}

impl Organ2d {
    /// The default long side of the working size, pixels: 40 ms a call on one core (spec/models.md).
    pub const LONG_SIDE: u32 = 384;

    /// Opens the network that the manifest at `path` describes (see [`crate::find_manifest`]), on `threads` threads.
    ///
    /// # Errors
    /// Those of [`Model::open`], and [`ModelError::Ports`] when the manifest describes another kind of network.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        let model = Model::open_as(runtime, path, threads, &[Layout::Organ2d])?;
        model.needs(&signature(&[("image", 3)]), &outputs())?;
        Ok(Self { model, long_side: Self::LONG_SIDE })
    }

    /// The same network working at another long side, in pixels.
    ///
    /// # Errors
    /// [`ModelError::LongSide`] unless it is a multiple of 16 from 16 to 2048.
    pub fn with_long_side(self, long_side: u32) -> Result<Self, ModelError> {
        Ok(Self { long_side: possible(long_side)?, ..self })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Runs the network on an image of any size; the maps come at the working size.
    ///
    /// # Errors
    /// [`ModelError::EmptyImage`], [`ModelError::Shape`], and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<OrganMaps, ModelError> {
        self.run_at(image, self.long_side)
    }

    /// [`Organ2d::run`] at another long side, in pixels.
    ///
    /// # Errors
    /// As there, and those of [`Organ2d::with_long_side`].
    pub fn run_at(&mut self, image: &Rgb, long_side: u32) -> Result<OrganMaps, ModelError> {
        let (width, height) = dimensions(image)?;
        let (w, h) = working_size(width, height, possible(long_side)?);
        let picture = planes(&resized(image, (w, h), FilterType::Triangle), |_, value| value / 255.0);
        let outputs = self.model.run(&[("image", picture.insert_axis(Axis(0)).into())])?;
        let map = |name, channels| outputs.f32(name, [1, channels, i64::from(h), i64::from(w)]);
        // Softmax; the largest logit is taken off first so that nothing overflows.
        let mut sem = map("sem", Semantic::ALL.len() as i64)?.index_axis(Axis(0), 0).to_owned();
        sem -= &sem.fold_axis(Axis(0), f32::NEG_INFINITY, |&a, &b| a.max(b));
        sem.mapv_inplace(f32::exp);
        sem /= &sem.sum_axis(Axis(0));
        let [sx, sy] = [f64::from(width) / f64::from(w), f64::from(height) / f64::from(h)];
        Ok(OrganMaps {
            probabilities: Semantic::ALL.map(|class| raster(sem.index_axis(Axis(0), class as usize))),
            dist: raster(map("dist", 1)?.slice(s![0, 0, .., ..])),
            log_depth: raster(map("depth", 1)?.slice(s![0, 0, .., ..])),
            scale: [sx, sy],
            camera: CameraGuess::of(outputs.f32("camera", [1, CameraGuess::NUMBERS as i64])?.row(0), sx / sy),
        })
    }
}

fn possible(long_side: u32) -> Result<u32, ModelError> {
    let is_possible = (1..=MAX_LONG_SIDE).contains(&long_side) && long_side.is_multiple_of(MULTIPLE);
    is_possible.then_some(long_side).ok_or(ModelError::LongSide { found: long_side })
}

pub(crate) fn signature(ports: &[(&str, i64)]) -> Vec<Port> {
    let port = |&(name, channels): &(&str, i64)| Port {
        name: name.to_owned(),
        shape: vec![-1, channels, -1, -1],
        dtype: "f32".to_owned(),
    };
    ports.iter().map(port).collect()
}

fn outputs() -> Vec<Port> {
    let mut ports = signature(&[("sem", Semantic::ALL.len() as i64), ("dist", 1), ("depth", 1)]);
    let shape = vec![-1, CameraGuess::NUMBERS as i64];
    ports.push(Port { name: "camera".to_owned(), shape, dtype: "f32".to_owned() });
    ports
}

/// The size nearest the image's proportions whose long side is `long_side` and whose sides are multiples of 16.
pub(crate) fn working_size(width: u32, height: u32, long_side: u32) -> (u32, u32) {
    let scale = f64::from(long_side) / f64::from(width.max(height));
    let side = |pixels: u32| {
        let multiples = (f64::from(pixels) * scale / f64::from(MULTIPLE)).round() as u32;
        multiples.clamp(1, long_side / MULTIPLE) * MULTIPLE
    };
    (side(width), side(height))
}

fn raster(values: ArrayView2<'_, f32>) -> ImageBuffer<Luma<f32>, Vec<f32>> {
    let (height, width) = values.dim();
    let mut raster = ImageBuffer::new(width as u32, height as u32);
    for (to, from) in raster.iter_mut().zip(values) {
        *to = *from;
    }
    raster
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn working_sizes_are_multiples_of_16_near_the_proportions() {
        assert_eq!(working_size(640, 480, 384), (384, 288));
        assert_eq!(working_size(480, 640, 384), (288, 384));
        assert_eq!(working_size(1, 1, 384), (384, 384));
        assert_eq!(working_size(16_384, 1, 384), (384, 16));
        for (width, height) in [(641, 479), (1920, 1080), (333, 1000), (17, 5)] {
            let (w, h) = working_size(width, height, 512);
            assert!(w % 16 == 0 && h % 16 == 0 && w.max(h) == 512, "{w} x {h}");
            let exact = f64::from(width.min(height)) / f64::from(width.max(height)) * 512.0;
            assert!((f64::from(w.min(h)) - exact).abs() <= 8.0, "{w} x {h}");
        }
    }
}
