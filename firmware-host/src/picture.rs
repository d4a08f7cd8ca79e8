//! The picture kept of a plant: its photo beside the same photo with the fitted plant drawn over it.

use std::io::Cursor;

use demeter_frame::{Intrinsics, Pose, Rgb};
use demeter_recon::model::{Detail, Knots, Plant, PlantError, PlantMesh, Species, forward};
use demeter_recon::view::overlay;
use image::imageops::{FilterType, crop_imm, replace, resize};
use image::{ImageBuffer, ImageError, ImageFormat, Pixel};

/// Margin around a plant, as a share of its larger side: room for what the network missed.
const MARGIN: f64 = 0.1;
/// Pixels between the two.
const GAP: u32 = 4;

/// A part of a picture with the camera that would have taken it.
#[derive(Clone, Debug, PartialEq)]
pub struct Crop<P = Rgb> {
    /// The pixels.
    pub picture: P,
    /// The camera for them.
    pub camera: Intrinsics,
}

impl<P: Pixel<Subpixel = u8> + 'static> Crop<ImageBuffer<P, Vec<u8>>> {
    /// The part of a picture around `[x0, y0, x1, y1]` (the last not included), shrunk until no side has more than
    /// `longest` pixels.
    #[must_use]
    pub fn around(
        whole: &ImageBuffer<P, Vec<u8>>,
        camera: &Intrinsics,
        [x0, y0, x1, y1]: [u32; 4],
        longest: u32,
    ) -> Self {
        let margin = (f64::from((x1 - x0).max(y1 - y0)) * MARGIN) as u32;
        let (x0, y0) = (x0.saturating_sub(margin), y0.saturating_sub(margin));
        let (x1, y1) = ((x1 + margin).min(whole.width()), (y1 + margin).min(whole.height()));
        let (width, height) = (x1 - x0, y1 - y0);
        let picture = crop_imm(whole, x0, y0, width, height).to_image();
        let (cx, cy) = (camera.cx - f64::from(x0), camera.cy - f64::from(y0));
        let camera = Intrinsics { width, height, cx, cy, ..*camera };
        let shrink = f64::from(longest) / f64::from(width.max(height));
        if shrink >= 1.0 {
            return Self { picture, camera };
        }
        let size = |side: u32| ((f64::from(side) * shrink).round() as u32).max(1);
        let (width, height) = (size(width), size(height));
        Self { picture: resize(&picture, width, height, FilterType::Triangle), camera: camera.resized(width, height) }
    }
}

impl Crop {
    /// Longest side of a crop that is kept, pixels: a thumbnail stays under about 200 KB.
    pub const THUMBNAIL: u32 = 480;

    /// The crop beside itself with the plant over it.
    ///
    /// # Errors
    /// [`PlantError`] when the plant is none.
    pub fn beside(&self, plant: &Plant, species: &Species, camera_from_world: Pose) -> Result<Rgb, PlantError> {
        let drawn = draw_over(&self.picture, &self.camera, plant, species, camera_from_world)?;
        let (width, height) = self.picture.dimensions();
        let mut pair = Rgb::from_pixel(2 * width + GAP, height, image::Rgb([255; 3]));
        replace(&mut pair, &self.picture, 0, 0);
        replace(&mut pair, &drawn, i64::from(width + GAP), 0);
        Ok(pair)
    }
}

/// A photo with a plant drawn over it.
///
/// # Errors
/// [`PlantError`] when the plant is none.
pub fn draw_over(
    photo: &Rgb,
    camera: &Intrinsics,
    plant: &Plant,
    species: &Species,
    camera_from_world: Pose,
) -> Result<Rgb, PlantError> {
    let mesh = PlantMesh::of(&forward(plant, species)?, Detail::Control, Knots::Uniform);
    Ok(overlay(photo, camera, camera_from_world, &mesh, plant))
}

/// A picture as PNG bytes.
///
/// # Errors
/// [`ImageError`] when it is too large for the format.
pub fn png(picture: &Rgb) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}
