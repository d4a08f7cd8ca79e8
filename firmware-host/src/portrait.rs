//! A photo to one fitted plant: by its organs in depth, or, where a grass is seen from the side, by its silhouette.

use demeter_frame::{Intrinsics, Pose, Rgb};
use demeter_recon::fit::{Fitted, in_picture, pictured};
use demeter_recon::model::{Habit, Plant, Species};
use demeter_recon::organs::ScaleSource;
use demeter_recon::view::strap::{SideView, Silhouette, Sketch};
use demeter_recon::view::{patches, sharpened, shown};
use glam::DVec3;
use image::GrayImage;

use crate::describe::{Described, Encoding, describe};
use crate::eye::{Eye, PlantSight, SightError};
use crate::picture::Crop;
use crate::reconstruct::{ReconstructError, organ_tree};
use crate::report::Camera;

/// Without a pose the camera is taken to be level: up is up in the picture.
const UP: DVec3 = DVec3::NEG_Y;
/// Depth of a plant when nothing tells it, metres: proportions hold, lengths mean nothing.
const NOMINAL_DEPTH: f64 = 1.0;
/// Longest side on which silhouettes are looked at, pixels: straps stay wider than a pixel, and it costs milliseconds.
pub const SILHOUETTE_SIDE: u32 = 800;
/// A plant whose box has less than this share of the picture's longer side is looked at again, nearer.
const NEARER: f64 = 0.6;
/// Patches smaller than this share of the largest one do not widen a plant's box.
const SPECK: f64 = 0.01;
/// A picture of this share of black and white pixels is a drawn silhouette; so far from either counts as it.
const DRAWN: f64 = 0.995;
const DRAWN_LEVELS: u8 = 24;

/// A plant fitted in the camera's frame.
pub struct Portrait {
    /// Its record and what is told of it, at its own origin.
    pub described: Described,
    /// The plant where the camera sees it.
    pub in_camera: Plant,
}

impl Portrait {
    /// A plant of its organs in depth.
    ///
    /// # Errors
    /// [`ReconstructError`] when they form no tree or cannot be fitted.
    pub fn of(
        sight: PlantSight,
        species: &Species,
        camera: &Intrinsics,
        scale_source: ScaleSource,
    ) -> Result<Self, ReconstructError> {
        let (stand_in, cut) = (sight.plant.stand_in, sight.plant.touches_border);
        let tree = organ_tree(sight.plant.organs)?;
        let fitted = in_picture(&tree, |organ, base| shown(&tree.organs[organ], base, camera), species, UP)?;
        let cloud = tree.organs.into_iter().flat_map(|organ| organ.points).collect();
        let mut portrait = Self::described(fitted, cloud, species, camera, scale_source)?;
        let warnings = &mut portrait.described.report.warnings;
        if stand_in {
            warnings.push("no main stem was seen: one was put through the leaves' bases".into());
        }
        if cut {
            warnings.push("the plant is cut by the photo's border".into());
        }
        Ok(portrait)
    }

    /// The plant of a silhouette, at `depth` metres; `None` when it is not that of a grass seen from the side.
    ///
    /// # Errors
    /// [`ReconstructError`] when it cannot be fitted.
    pub fn of_silhouette(
        silhouette: &Crop<GrayImage>,
        depth: f64,
        species: &Species,
        camera: &Intrinsics,
    ) -> Result<Option<Self>, ReconstructError> {
        let Some(sketch) = Sketch::of(&Silhouette::of(&silhouette.picture)) else { return Ok(None) };
        let raised = sketch.raised(&SideView { camera: silhouette.camera, depth });
        let fitted = pictured(&raised.stem, &raised.blades, species, UP)?;
        let nodes = raised.blades.into_iter().flat_map(|blade| blade.nodes);
        let mut portrait = Self::described(
            fitted,
            raised.stem.into_iter().chain(nodes).collect(),
            species,
            camera,
            ScaleSource::None,
        )?;
        let warning = "depth is not seen in a silhouette: leaves are taken to stand in the picture's plane";
        portrait.described.report.warnings.push(warning.into());
        Ok(Some(portrait))
    }

    /// The world is unknown: the plant is recorded at its own origin, and where that is seen from is reported.
    fn described(
        mut fitted: Fitted,
        mut cloud: Vec<DVec3>,
        species: &Species,
        camera: &Intrinsics,
        scale_source: ScaleSource,
    ) -> Result<Self, ReconstructError> {
        let camera_from_plant = std::mem::replace(&mut fitted.plant.world_from_plant, Pose::IDENTITY);
        let plant_from_camera = camera_from_plant.inverse();
        cloud.iter_mut().for_each(|p| *p = plant_from_camera.point(*p));
        let mut described = describe(&fitted, species, &cloud, scale_source, Encoding::Compact)?;
        described.report.camera = Some(Camera { intrinsics: *camera, camera_from_plant });
        let in_camera = Plant { world_from_plant: camera_from_plant, ..described.plant.clone() };
        Ok(Self { described, in_camera })
    }
}

/// The largest plant of a photo if it is a grass seen from the side, `None` when it is none.
///
/// # Errors
/// [`PortraitError`] when the network fails or the plant cannot be fitted.
pub fn grass(
    eye: &mut Eye,
    photo: &Rgb,
    camera: &Intrinsics,
    species: &Species,
) -> Result<Option<Portrait>, PortraitError> {
    if species.habit != Habit::Grass {
        return Ok(None);
    }
    let Some(silhouette) = silhouette(eye, photo, camera)? else { return Ok(None) };
    Ok(Portrait::of_silhouette(&silhouette, NOMINAL_DEPTH, species, camera)?)
}

/// Why a photo gave no plant.
#[derive(Debug, thiserror::Error)]
pub enum PortraitError {
    /// The network failed.
    #[error(transparent)]
    Sight(#[from] SightError),
    /// The plant cannot be fitted.
    #[error(transparent)]
    Reconstruct(#[from] ReconstructError),
}

/// The silhouette of the largest plant: drawn, or what the network and the photo's colours say, looked at again from
/// near where the plant is small.
fn silhouette(eye: &mut Eye, photo: &Rgb, camera: &Intrinsics) -> Result<Option<Crop<GrayImage>>, SightError> {
    if let Some(drawn) = drawn(photo) {
        let Some(bounds) = bounds(&drawn) else { return Ok(None) };
        let crop = Crop::around(&drawn, camera, bounds, SILHOUETTE_SIDE);
        return Ok(Some(crop));
    }
    let whole = Crop::around(photo, camera, [0, 0, photo.width(), photo.height()], SILHOUETTE_SIDE);
    let mask = sharpened(&whole.picture, &eye.plants(&whole.picture)?);
    let Some(bounds) = bounds(&mask) else { return Ok(None) };
    let [x0, y0, x1, y1] = bounds;
    let share = f64::from((x1 - x0).max(y1 - y0)) / f64::from(mask.width().max(mask.height()));
    if share > NEARER {
        return Ok(Some(Crop { picture: mask, camera: whole.camera }));
    }
    let (sx, sy) =
        (f64::from(photo.width()) / f64::from(mask.width()), f64::from(photo.height()) / f64::from(mask.height()));
    let near = [f64::from(x0) * sx, f64::from(y0) * sy, f64::from(x1) * sx, f64::from(y1) * sy].map(|v| v as u32);
    let near = Crop::around(photo, camera, near, SILHOUETTE_SIDE);
    let picture = sharpened(&near.picture, &eye.plants(&near.picture)?);
    Ok(Some(Crop { picture, camera: near.camera }))
}

/// The silhouette that a picture of two colours is: the colour less of which lies on its border.
fn drawn(picture: &Rgb) -> Option<GrayImage> {
    let white = |p: &image::Rgb<u8>| p.0.iter().all(|&c| c >= 255 - DRAWN_LEVELS);
    let black = |p: &image::Rgb<u8>| p.0.iter().all(|&c| c <= DRAWN_LEVELS);
    let (mut whites, mut blacks) = (0usize, 0usize);
    for pixel in picture.pixels() {
        whites += usize::from(white(pixel));
        blacks += usize::from(black(pixel));
    }
    let all = picture.pixels().len();
    if whites == 0 || blacks == 0 || ((whites + blacks) as f64) < DRAWN * all as f64 {
        return None;
    }
    let (width, height) = picture.dimensions();
    let border = picture.enumerate_pixels().filter(|(x, y, _)| *x == 0 || *y == 0 || x + 1 == width || y + 1 == height);
    let (mut on_border, mut white_there) = (0usize, 0usize);
    for (_, _, pixel) in border {
        on_border += 1;
        white_there += usize::from(white(pixel));
    }
    let plant_is_white = 2 * white_there < on_border;
    let value = |p: &image::Rgb<u8>| if (p.0[1] > 127) == plant_is_white { 255 } else { 0 };
    Some(GrayImage::from_fn(width, height, |x, y| image::Luma([value(picture.get_pixel(x, y))])))
}

/// The box `[x0, y0, x1, y1]` (the last not included) of a mask's patches, specks left out.
fn bounds(mask: &GrayImage) -> Option<[u32; 4]> {
    let patches = patches(mask);
    let largest = patches.iter().map(|patch| patch.pixels.len()).max()? as f64;
    let boxes = patches.iter().filter(|patch| patch.pixels.len() as f64 >= SPECK * largest).map(|patch| patch.bounds);
    boxes.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
}
