//! What is green in a real photo, which stands for the plants in it where nobody drew them.

use demeter_frame::Rgb;
use image::GrayImage;

/// Excess green (Woebbecke et al. 1995) of chromatic coordinates, 2g - r - b: above 0 is greener than grey. Where plants
/// begin, by eye: soil and stones stay below 0.03, shaded leaves above 0.1.
const PLANT: f32 = 0.06;

/// 255 where a picture is green, else 0.
pub(super) fn green(picture: &Rgb) -> GrayImage {
    GrayImage::from_fn(picture.width(), picture.height(), |x, y| {
        let [r, g, b] = picture.get_pixel(x, y).0.map(f32::from);
        let excess = (2.0 * g - r - b) / (r + g + b).max(1.0);
        image::Luma([if excess > PLANT { 255 } else { 0 }])
    })
}
