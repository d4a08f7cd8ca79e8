//! Networks together: organ2d says all of a picture; relief2d gives the depth of photos, and other people's say part of it
//! better where they are configured (docs/models.md).

use std::borrow::Cow;
use std::num::NonZeroUsize;

use demeter_frame::{Depth, Instances, Intrinsics, Mask, Rgb, Semantic};
use demeter_models::{
    DepthMap, DepthNetwork, Instance, Model, ModelError, Organ2d, OrganMaps, OrganNetwork, Runtime, find_manifest,
};
use demeter_recon::view::{self, Region, View, ViewError};
use demeter_recon::world::boundary_distance;
use image::imageops::{FilterType, resize};
use image::{GrayImage, Luma};

use crate::config::{ModelsConfig, OURS};
use crate::cutter::Cutter;
use crate::error::chain;
use crate::eye::EyeError;
use crate::raster::nearest;

/// The longest side of a picture given to any network but organ2d, pixels: the largest that one of them works at inside,
/// and their answers grow with it.
const LONG_SIDE: u32 = 1024;

/// What stands in for what failed, and why: [`Networks`] go on with ours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Degraded {
    /// `mask`, `organs` or `depth`.
    pub role: &'static str,
    /// Why the configured network gave none.
    pub why: String,
}

impl std::fmt::Display for Degraded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "models.{}: {}; organ2d does it instead", self.role, self.why)
    }
}

/// What the networks say of a picture, at the size of ours.
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) semantic: GrayImage,
    pub(crate) dist: Mask,
    pub(crate) log_depth: Depth,
    /// Organs that a detector divided already.
    pub(crate) divided: Option<Instances>,
    /// Depth is in metres.
    pub(crate) metric: bool,
    /// Pixels of the picture per pixel of these, along x and y.
    pub(crate) scale: [f64; 2],
    /// What failed on this picture.
    pub(crate) degraded: Vec<Degraded>,
}

/// Our network and those beside it.
#[derive(Debug)]
pub(crate) struct Networks {
    ours: Organ2d,
    mask: Option<Cutter>,
    organs: Option<OrganNetwork>,
    depth: Option<DepthNetwork>,
    /// What could not be opened.
    pub(crate) degraded: Vec<Degraded>,
}

impl Networks {
    /// Opens what is configured. Ours must open; what of the others does not is left out and said.
    pub(crate) fn open(config: &ModelsConfig, threads: NonZeroUsize) -> Result<Self, EyeError> {
        let runtime = Runtime::load(None)?;
        let ours = Organ2d::open(&runtime, &find_manifest(OURS)?, threads)?;
        let mut degraded = Vec::new();
        let mask = kept("mask", Cutter::open(&runtime, &config.mask, threads), &mut degraded).flatten();
        let organs = (config.organs != OURS)
            .then(|| find_manifest(&config.organs).and_then(|path| OrganNetwork::open(&runtime, &path, threads)));
        let depth = (config.depth != OURS)
            .then(|| find_manifest(&config.depth).and_then(|path| DepthNetwork::open(&runtime, &path, threads)));
        let organs = organs.and_then(|opened| kept("organs", opened, &mut degraded));
        let depth = depth.and_then(|opened| kept("depth", opened, &mut degraded));
        Ok(Self { ours, mask, organs, depth, degraded })
    }

    /// The same with ours working at another long side, in pixels.
    pub(crate) fn with_long_side(self, long_side: u32) -> Result<Self, EyeError> {
        Ok(Self { ours: self.ours.with_long_side(long_side)?, ..self })
    }

    /// Ours first.
    pub(crate) fn models(&self) -> Vec<&Model> {
        let mask = self.mask.iter().flat_map(Cutter::models);
        let organs = self.organs.iter().map(OrganNetwork::model);
        std::iter::once(self.ours.model())
            .chain(mask)
            .chain(organs)
            .chain(self.depth.iter().map(DepthNetwork::model))
            .collect()
    }

    /// What ours says of a picture.
    pub(crate) fn maps(&mut self, picture: &Rgb) -> Result<OrganMaps, ModelError> {
        self.ours.run(picture)
    }

    /// The same of a picture made `long_side` pixels long.
    pub(crate) fn maps_at(&mut self, picture: &Rgb, long_side: u32) -> Result<OrganMaps, ModelError> {
        self.ours.run_at(picture, long_side)
    }

    /// Nobody else's says what is a plant or an organ.
    pub(crate) fn organs_are_ours(&self) -> bool {
        self.mask.is_none() && self.organs.is_none()
    }

    /// The scene of a picture and what ours says of it; what of the others fails is left out and said.
    pub(crate) fn scene(&mut self, picture: &Rgb, maps: OrganMaps, camera: &Intrinsics) -> Result<Scene, ViewError> {
        let semantic = maps.semantic();
        let (width, height) = semantic.dimensions();
        let mut degraded = Vec::new();
        let working = if self.models().len() > 1 { bounded(picture) } else { Cow::Borrowed(picture) };
        let mask = match &mut self.mask {
            Some(cutter) => {
                let (raster, regions) = ours_divided(&maps, &semantic, camera)?;
                kept("mask", cutter.run(&working, &maps, (&raster, &regions)), &mut degraded)
            }
            None => None,
        };
        let organs = self.organs.as_mut().and_then(|network| kept("organs", network.run(&working), &mut degraded));
        let depth = self.depth.as_mut().and_then(|network| kept("depth", network.run(&working), &mut degraded));

        let mut scene = Scene {
            semantic,
            dist: maps.dist,
            metric: matches!(depth, Some(DepthMap::Metric(_))),
            log_depth: depth.map_or(maps.log_depth, |depth| nearest(&depth.log_depth(), width, height)),
            divided: None,
            scale: maps.scale,
            degraded,
        };
        if let Some(organs) = organs {
            scene.divide(&organs, working.dimensions());
        }
        if let Some(mask) = mask {
            scene.cut(&mask);
        }
        if let Some(ids) = &scene.divided {
            // What our network would say of organs that are known.
            scene.dist = boundary_distance(ids);
        }
        Ok(scene)
    }
}

/// What was opened or found; why not is noted.
fn kept<T>(role: &'static str, result: Result<T, ModelError>, degraded: &mut Vec<Degraded>) -> Option<T> {
    result.map_err(|error| degraded.push(Degraded { role, why: chain(&error) })).ok()
}

/// The picture at most [`LONG_SIDE`] pixels long.
fn bounded(picture: &Rgb) -> Cow<'_, Rgb> {
    let (width, height) = picture.dimensions();
    let long = width.max(height);
    if long <= LONG_SIDE {
        return Cow::Borrowed(picture);
    }
    let side = |pixels: u32| (pixels * LONG_SIDE / long).max(1);
    Cow::Owned(resize(picture, side(width), side(height), FilterType::Triangle))
}

fn ours_divided(
    maps: &OrganMaps,
    semantic: &GrayImage,
    camera: &Intrinsics,
) -> Result<(Instances, Vec<Region>), ViewError> {
    let (width, height) = semantic.dimensions();
    let (dist, log_depth, intrinsics) = (&maps.dist, &maps.log_depth, camera.resized(width, height));
    let view = View { semantic, dist, log_depth, intrinsics, world_from_camera: None }.validated()?;
    Ok(view::instances(&view))
}

impl Scene {
    /// Takes a detector's organs, the surest first, in a picture of this size: where two overlap the surer is seen.
    fn divide(&mut self, organs: &[Instance], (width, height): (u32, u32)) {
        let mut ids = Instances::new(width, height);
        for (id, organ) in organs.iter().enumerate().rev() {
            // Detectors give at most 300.
            let id = u16::try_from(id + 1).unwrap_or(u16::MAX);
            organ.pixels().for_each(|(x, y)| ids.put_pixel(x, y, Luma([id])));
        }
        let ids = nearest(&ids, self.semantic.width(), self.semantic.height());
        for (class, &id) in self.semantic.iter_mut().zip(ids.iter()) {
            let organ = usize::from(id).checked_sub(1).map_or(Semantic::Background, |i| organs[i].organ);
            *class = organ as u8;
        }
        self.divided = Some(ids);
    }

    /// Leaves nothing outside a mask.
    fn cut(&mut self, mask: &GrayImage) {
        for (class, &inside) in self.semantic.iter_mut().zip(mask.iter()) {
            if inside == 0 {
                *class = Semantic::Background as u8;
            }
        }
        if let Some(ids) = &mut self.divided {
            ids.iter_mut().zip(mask.iter()).filter(|(_, inside)| **inside == 0).for_each(|(id, _)| *id = 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let side = |value: f32| Mask::from_pixel(4, 2, Luma([value]));
        Scene {
            semantic: GrayImage::from_pixel(4, 2, Luma([Semantic::Leaf as u8])),
            dist: side(0.0),
            log_depth: side(0.0),
            divided: None,
            metric: false,
            scale: [1.0; 2],
            degraded: Vec::new(),
        }
    }

    fn organ(organ: Semantic, at: [u32; 2], width: u32, height: u32) -> Instance {
        Instance { organ, score: 0.9, at, mask: GrayImage::from_pixel(width, height, Luma([255])) }
    }

    #[test]
    fn the_surer_organ_is_seen_and_what_no_detector_found_is_background() {
        let mut scene = scene();
        // A picture of twice the size; the surer organ comes first and covers part of the other.
        scene.divide(&[organ(Semantic::Stem, [2, 0], 2, 4), organ(Semantic::Leaf, [0, 0], 6, 4)], (8, 4));
        assert_eq!(scene.semantic.as_raw(), &[1, 2, 1, 0, 1, 2, 1, 0]);
        assert_eq!(scene.divided.unwrap().as_raw(), &[2, 1, 2, 0, 2, 1, 2, 0]);
    }

    #[test]
    fn nothing_is_left_outside_a_mask() {
        let mut scene = scene();
        scene.divide(&[organ(Semantic::Leaf, [0, 0], 4, 2)], (4, 2));
        let mask = GrayImage::from_fn(4, 2, |x, _| Luma([if x < 2 { 255 } else { 0 }]));
        scene.cut(&mask);
        assert_eq!(scene.semantic.as_raw(), &[1, 1, 0, 0, 1, 1, 0, 0]);
        assert_eq!(scene.divided.unwrap().as_raw(), &[1, 1, 0, 0, 1, 1, 0, 0]);
    }
}
