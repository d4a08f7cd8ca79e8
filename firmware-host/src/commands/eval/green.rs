//! What is green in a real photo, which stands for the plants in it where nobody drew them.

use demeter_frame::Rgb;
use demeter_recon::view::excess_green;
use image::GrayImage;

/// The excess green at which plants begin, by eye: soil and stones stay below 0.03, shaded leaves above 0.1.
const PLANT: f64 = 0.06;

/// 255 where a picture is green, else 0.
pub(super) fn green(picture: &Rgb) -> GrayImage {
    GrayImage::from_fn(picture.width(), picture.height(), |x, y| {
        image::Luma([if excess_green(picture.get_pixel(x, y)) > PLANT { 255 } else { 0 }])
    })
}
