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
