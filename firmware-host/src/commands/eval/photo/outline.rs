//! Outlines of plants: rendered, and how far two agree.

use demeter_frame::{Intrinsics, Pose, Rgb};
use demeter_recon::model::{Plant, Species};
use image::GrayImage;

use crate::error::CommandError;
use crate::picture::draw_over;

/// The mask of a plant as a camera sees it.
///
/// # Errors
/// [`CommandError`] `overlay` when the plant is none.
pub(super) fn rendered(
    plant: &Plant,
    species: &Species,
    camera: &Intrinsics,
    camera_from_world: Pose,
) -> Result<GrayImage, CommandError> {
    let black = Rgb::new(camera.width, camera.height);
    let drawn = draw_over(&black, camera, plant, species, camera_from_world)
        .map_err(|error| CommandError::failed("overlay", &error))?;
    Ok(GrayImage::from_fn(camera.width, camera.height, |x, y| {
        image::Luma([if drawn.get_pixel(x, y).0 == [0; 3] { 0 } else { 255 }])
    }))
}

/// Intersection over union of two masks of a size; 0 when both are empty.
pub(super) fn iou(a: &GrayImage, b: &GrayImage) -> f64 {
    let (mut both, mut either) = (0usize, 0usize);
    for (a, b) in a.as_raw().iter().zip(b.as_raw()) {
        both += usize::from(*a > 0 && *b > 0);
        either += usize::from(*a > 0 || *b > 0);
    }
    both as f64 / either.max(1) as f64
}

/// A photo with a mask's pixels tinted.
pub(super) fn tinted(photo: &Rgb, mask: &GrayImage) -> Rgb {
    Rgb::from_fn(photo.width(), photo.height(), |x, y| {
        let [r, g, b] = photo.get_pixel(x, y).0;
        image::Rgb(if mask.get_pixel(x, y).0[0] > 0 { [r / 2 + 127, g / 2, b / 2 + 127] } else { [r, g, b] })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agreement_of_outlines() {
        let mask = |from: u32, to: u32| {
            GrayImage::from_fn(10, 4, |x, _| image::Luma([if (from..to).contains(&x) { 255 } else { 0 }]))
        };
        assert_eq!(iou(&mask(0, 6), &mask(0, 6)), 1.0);
        assert_eq!(iou(&mask(0, 6), &mask(3, 9)), 3.0 / 9.0);
        assert_eq!(iou(&mask(0, 3), &mask(3, 9)), 0.0);
        assert_eq!(iou(&mask(0, 0), &mask(0, 0)), 0.0);
    }
}
