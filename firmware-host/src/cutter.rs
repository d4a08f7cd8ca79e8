//! Other people's network that parts plants from the rest.

use std::num::NonZeroUsize;

use demeter_frame::{Instances, Rgb};
use demeter_models::{Embedding, Model, ModelError, OrganMaps, Runtime, SamDecoder, SamEncoder, U2net, find_manifest};
use demeter_recon::view::Region;
use image::{GrayImage, Luma};

use crate::raster::nearest;

/// How much a pixel must stand out to be plant: the middle of what the network gives.
const SALIENT: f32 = 0.5;
/// Most points asked of SAM in one picture, those of the largest organs: 30 ms each (a guess at a photo's patience).
const MAX_SEEDS: usize = 32;
/// A cutout of which our network takes less than this share for plant is ground or sky (a guess: an even chance).
const MIN_PLANT: f64 = 0.5;

/// What gives a mask of the plants.
#[derive(Debug)]
pub(crate) enum Cutter {
    /// What stands out.
    Salient(Box<U2net>),
    /// What is at points of our network's organs.
    Sam(Box<(SamEncoder, SamDecoder)>),
}

impl Cutter {
    /// Opens one network, U²-Net, or two, SAM's encoder and decoder; `None` for none.
    pub(crate) fn open(runtime: &Runtime, names: &[String], threads: NonZeroUsize) -> Result<Option<Self>, ModelError> {
        Ok(match names {
            [one] => Some(Self::Salient(Box::new(U2net::open(runtime, &find_manifest(one)?, threads)?))),
            [encoder, decoder] => Some(Self::Sam(Box::new((
                SamEncoder::open(runtime, &find_manifest(encoder)?, threads)?,
                SamDecoder::open(runtime, &find_manifest(decoder)?, threads)?,
            )))),
            _ => None,
        })
    }

    pub(crate) fn models(&self) -> Vec<&Model> {
        match self {
            Self::Salient(network) => vec![network.model()],
            Self::Sam(sam) => vec![sam.0.model(), sam.1.model()],
        }
    }

    /// 255 where a picture shows plants, of our maps' size; `organs` are our network's.
    pub(crate) fn run(
        &mut self,
        picture: &Rgb,
        maps: &OrganMaps,
        organs: (&Instances, &[Region]),
    ) -> Result<GrayImage, ModelError> {
        let (width, height) = maps.dist.dimensions();
        match self {
            Self::Salient(network) => {
                let salient = nearest(&network.run(picture)?, width, height);
                Ok(GrayImage::from_fn(width, height, |x, y| {
                    Luma([if salient.get_pixel(x, y).0[0] >= SALIENT { 255 } else { 0 }])
                }))
            }
            Self::Sam(sam) => {
                let (encoder, decoder) = &mut **sam;
                let embedding = encoder.run(picture)?;
                cut(decoder, &embedding, picture.dimensions(), maps, organs)
            }
        }
    }
}

/// The cutouts at our organs' surest pixels, all together; organs that an earlier cutout holds are not asked for.
fn cut(
    decoder: &mut SamDecoder,
    embedding: &Embedding,
    (full_width, full_height): (u32, u32),
    maps: &OrganMaps,
    (raster, regions): (&Instances, &[Region]),
) -> Result<GrayImage, ModelError> {
    let (width, height) = maps.dist.dimensions();
    let background = &maps.probabilities[0];
    let mut plants = GrayImage::new(width, height);
    let mut regions: Vec<&Region> = regions.iter().collect();
    regions.sort_by_key(|region| std::cmp::Reverse(region.pixels));
    let mut asked = 0;
    for region in regions {
        // Far from other organs and surely plant.
        let sure =
            |&(x, y): &(u32, u32)| (1.0 - background.get_pixel(x, y).0[0]) * (1.0 - maps.dist.get_pixel(x, y).0[0]);
        let [x0, y0, x1, y1] = region.bounds;
        let inside = (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (x, y)));
        let own = inside.filter(|&(x, y)| raster.get_pixel(x, y).0[0] == region.id);
        let Some(seed) = own.max_by(|a, b| sure(a).total_cmp(&sure(b))) else { continue };
        if plants.get_pixel(seed.0, seed.1).0[0] > 0 {
            continue;
        }
        let place = |at: u32, small: u32, full: u32| (2 * at + 1) * full / (2 * small);
        let cutout = decoder.run(embedding, [place(seed.0, width, full_width), place(seed.1, height, full_height)])?;
        let mask = nearest(&cutout.mask, width, height);
        let (mut pixels, mut plant) = (0, 0.0);
        for (_, probability) in mask.iter().zip(background.iter()).filter(|(cut, _)| **cut > 0) {
            pixels += 1;
            plant += 1.0 - f64::from(*probability);
        }
        if plant >= MIN_PLANT * f64::from(pixels) {
            plants.iter_mut().zip(mask.iter()).for_each(|(all, one)| *all = (*all).max(*one));
        }
        asked += 1;
        if asked == MAX_SEEDS {
            break;
        }
    }
    Ok(plants)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use demeter_frame::{Depth, Mask, Tilt};
    use demeter_models::{CameraGuess, Candidate};
    use demeter_recon::model::OrganKind;
    use glam::DVec3;

    use super::*;

    /// SAM 2's small graphs, whose cutouts are all that is to the left of the point.
    fn sam() -> (SamEncoder, SamDecoder) {
        let (runtime, folder) = (Runtime::load(None).unwrap(), tempfile::tempdir().unwrap());
        let install = |name: &str| {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../models/tests/fixtures/{name}.onnx"));
            Candidate::examine(&runtime, &file, None).unwrap().install(folder.path(), false).unwrap()
        };
        let (encoder, decoder) = (install("sam2_encoder"), install("sam2_decoder"));
        let one = NonZeroUsize::MIN;
        (SamEncoder::open(&runtime, &encoder, one).unwrap(), SamDecoder::open(&runtime, &decoder, one).unwrap())
    }

    /// One leaf over some columns, its surest pixel in the last of them.
    fn leaf(columns: std::ops::Range<u32>) -> (OrganMaps, Instances, Region) {
        let (width, height) = (16, 8);
        let is = |x: u32| columns.contains(&x);
        let plant = Mask::from_fn(width, height, |x, _| Luma([if is(x) { 1.0 } else { 0.0 }]));
        let ground = Mask::from_fn(width, height, |x, _| Luma([if is(x) { 0.0 } else { 1.0 }]));
        let none = Mask::new(width, height);
        let dist = Mask::from_fn(width, height, |x, _| Luma([if x + 1 == columns.end { 0.1 } else { 0.9 }]));
        let maps = OrganMaps {
            probabilities: [ground, plant, none.clone(), none],
            dist,
            log_depth: Depth::new(width, height),
            scale: [4.0; 2],
            camera: CameraGuess { hfov: 1.0, tilt: Tilt::of_up(DVec3::NEG_Y), hfov_spread: 0.1, tilt_spread: 0.1 },
        };
        let raster = Instances::from_fn(width, height, |x, _| Luma([u16::from(is(x))]));
        let bounds = [columns.start, 0, columns.end - 1, height - 1];
        let region = Region { id: 1, kind: OrganKind::Leaf, pixels: 8, touches_border: true, bounds };
        (maps, raster, region)
    }

    #[test]
    fn sam_is_asked_at_our_surest_pixel_and_ground_is_left_out() {
        let mut cutter = Cutter::Sam(Box::new(sam()));
        let picture = Rgb::from_pixel(64, 32, image::Rgb([20, 200, 20]));
        let mut cut = |columns| {
            let (maps, raster, region) = leaf(columns);
            cutter.run(&picture, &maps, (&raster, &[region])).unwrap()
        };
        // The point is in the middle of column 9 of 16, pixel 38 of 64: what is left of it.
        let mask = cut(0..10);
        assert!(mask.enumerate_pixels().all(|(x, _, pixel)| (pixel.0[0] > 0) == (x < 10) || x == 9));
        assert!(mask.get_pixel(8, 4).0[0] > 0);
        // A leaf of one column: the cutout is nearly all ground.
        assert!(cut(12..13).iter().all(|&pixel| pixel == 0));
    }
}
