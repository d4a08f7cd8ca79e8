use std::num::NonZeroUsize;
use std::path::Path;

use demeter_frame::Rgb;
use image::imageops::FilterType;
use image::{GrayImage, Luma};
use ndarray::{Array, Array1, Array3, ArrayView2, Axis, Dimension, Ix4, array, s};

use crate::pixels::{dimensions, imagenet, planes, resized, stretched};
use crate::{Layout, Model, ModelError, Outputs, Runtime, Tensor};

/// The side of its pictures, pixels.
const SIDE: u32 = 1024;

/// A picture as an encoder of SAM gives it to the decoder.
#[derive(Clone, Debug)]
pub struct Embedding {
    tensors: Vec<(&'static str, Tensor)>,
    /// Width and height of the picture.
    size: (u32, u32),
}

/// What a decoder cuts out.
#[derive(Clone, Debug, PartialEq)]
pub struct Cutout {
    /// 255 where it is, 0 elsewhere; of the picture's size.
    pub mask: GrayImage,
    /// How well the network thinks that it did (IoU).
    pub score: f32,
}

/// The image encoder of SAM, MobileSAM (Kirillov et al. 2023, Zhang et al. 2023) or SAM 2 (Ravi et al. 2024).
///
/// SAM: [1, 3, 1024, 1024], RGB as in ImageNet's statistics, the long side 1024 and zeros to the right and below; or
/// [h, w, 3] in 0..=255, the rest inside. SAM 2: stretched to 1024 x 1024.
#[derive(Debug)]
pub struct SamEncoder {
    model: Model,
}

impl SamEncoder {
    /// Opens the encoder that the manifest at `path` describes, on `threads` threads.
    ///
    /// # Errors
    /// Those of [`Model::open`], and [`ModelError::Ports`] when it is another network.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        let layouts = [Layout::SamEncoder, Layout::Sam2Encoder];
        Ok(Self { model: Model::open_as(runtime, path, threads, &layouts)? })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Encodes a picture, the slow part.
    ///
    /// # Errors
    /// [`ModelError`]: an empty picture, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<Embedding, ModelError> {
        let size = dimensions(image)?;
        let normal = |channel, value| imagenet(channel, value / 255.0);
        if self.model.manifest().layout == Layout::Sam2Encoder {
            let picture = planes(&resized(image, (SIDE, SIDE), FilterType::Triangle), normal);
            let outputs = self.model.run(&[("image", picture.insert_axis(Axis(0)).into())])?;
            let tensors = vec![
                ("image_embed", owned(&outputs, "image_embed", [1, 256, 64, 64])?),
                ("high_res_feats_0", owned(&outputs, "high_res_feats_0", [1, 32, 256, 256])?),
                ("high_res_feats_1", owned(&outputs, "high_res_feats_1", [1, 64, 128, 128])?),
            ];
            return Ok(Embedding { tensors, size });
        }
        let inner = resized(image, inner(size), FilterType::Triangle);
        let rank = self.model.manifest().inputs.first().map_or(0, |port| port.shape.len());
        let picture = if rank == 3 {
            planes(&inner, |_, value| value).permuted_axes([1, 2, 0]).into()
        } else {
            let mut framed = Array3::zeros((3, SIDE as usize, SIDE as usize));
            let (w, h) = inner.dimensions();
            framed.slice_mut(s![.., ..h as usize, ..w as usize]).assign(&planes(&inner, normal));
            framed.insert_axis(Axis(0)).into()
        };
        let outputs = self.model.run(&[("input_image", picture)])?;
        let tensors = vec![("image_embeddings", owned(&outputs, "image_embeddings", [1, 256, 64, 64])?)];
        Ok(Embedding { tensors, size })
    }
}

/// The picture's size when its long side is 1024.
fn inner((width, height): (u32, u32)) -> (u32, u32) {
    let scale = scale((width, height));
    let side = |pixels: u32| ((pixels as f32 * scale).round() as u32).clamp(1, SIDE);
    (side(width), side(height))
}

fn scale((width, height): (u32, u32)) -> f32 {
    SIDE as f32 / width.max(height) as f32
}

fn owned(outputs: &Outputs, name: &str, shape: [i64; 4]) -> Result<Tensor, ModelError> {
    Ok(outputs.f32(name, shape)?.to_owned().into())
}

/// The decoder that belongs to an encoder: a point of something to that thing's mask.
#[derive(Debug)]
pub struct SamDecoder {
    model: Model,
}

impl SamDecoder {
    /// Opens the decoder that the manifest at `path` describes, on `threads` threads.
    ///
    /// # Errors
    /// Those of [`Model::open`], and [`ModelError::Ports`] when it is another network.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        let layouts = [Layout::SamDecoder, Layout::Sam2Decoder];
        Ok(Self { model: Model::open_as(runtime, path, threads, &layouts)? })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// An embedding of nothing, that this decoder takes: to see whether it runs.
    #[must_use]
    pub fn blank(&self) -> Embedding {
        let zeros = |name, shape| (name, Array::<f32, Ix4>::zeros(shape).into());
        let tensors = if self.model.manifest().layout == Layout::Sam2Decoder {
            vec![
                zeros("image_embed", (1, 256, 64, 64)),
                zeros("high_res_feats_0", (1, 32, 256, 256)),
                zeros("high_res_feats_1", (1, 64, 128, 128)),
            ]
        } else {
            vec![zeros("image_embeddings", (1, 256, 64, 64))]
        };
        Embedding { tensors, size: (SIDE, SIDE) }
    }

    /// Cuts out what is at a pixel; of several answers the one that the network thinks best of.
    ///
    /// # Errors
    /// [`ModelError`]: an embedding of the other kind, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, picture: &Embedding, [x, y]: [u32; 2]) -> Result<Cutout, ModelError> {
        let (width, height) = picture.size;
        let two = self.model.manifest().layout == Layout::Sam2Decoder;
        let mut inputs = picture.tensors.clone();
        inputs.push(("mask_input", zeros((1, 1, 256, 256))));
        inputs.push(("has_mask_input", zeros(1)));
        if two {
            let (sx, sy) = (SIDE as f32 / width as f32, SIDE as f32 / height as f32);
            inputs.push(("point_coords", array![[[x as f32 * sx, y as f32 * sy]]].into()));
            inputs.push(("point_labels", array![[1f32]].into()));
        } else {
            let scale = scale(picture.size);
            // Without a box a second point that is none must follow.
            inputs.push(("point_coords", array![[[x as f32 * scale, y as f32 * scale], [0.0, 0.0]]].into()));
            inputs.push(("point_labels", array![[1f32, -1.0]].into()));
            inputs.push(("orig_im_size", Array1::from(vec![height as f32, width as f32]).into()));
        }
        let outputs = self.model.run(&inputs)?;
        let scores = outputs.f32("iou_predictions", [1, -1])?;
        let count = scores.len() as i64;
        // SAM gives logits of the picture's pixels, SAM 2 of the stretched picture at a quarter.
        let sides = if two { [-1, -1] } else { [height.into(), width.into()] };
        let logits = outputs.f32("masks", [1, count, sides[0], sides[1]])?;
        let best = scores.iter().enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let Some((best, &score)) = best.filter(|_| !logits.is_empty()) else {
            let name = self.model.manifest().name.clone();
            let (expected, found) = (vec![1, 1, sides[0], sides[1]], logits.shape().to_vec());
            return Err(ModelError::Shape { name, output: "masks".into(), expected, found });
        };
        Ok(Cutout { mask: positive(logits.slice(s![0, best, .., ..]), picture.size), score })
    }
}

fn zeros<D: Dimension, S: ndarray::ShapeBuilder<Dim = D>>(shape: S) -> Tensor {
    Array::<f32, D>::zeros(shape).into()
}

fn positive(logits: ArrayView2<'_, f32>, size: (u32, u32)) -> GrayImage {
    let logits = stretched(logits, size);
    GrayImage::from_fn(size.0, size.1, |x, y| Luma([if logits.get_pixel(x, y).0[0] > 0.0 { 255 } else { 0 }]))
}
