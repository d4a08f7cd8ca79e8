//! Photos of plants far away, as of a field: too small for the size that our network works at.

use demeter_frame::{Mask, Rgb, Semantic};
use demeter_models::OrganMaps;
use demeter_recon::view::{patches, sharpened};
use image::imageops::{FilterType, resize};
use image::{GrayImage, Luma};

/// What such a photo is made, pixels along its longer side. Of 512, 640 and 768 (docs/training.md).
pub(crate) const LONG_SIDE: u32 = 768;

/// Plants are far away when the largest connected part of them covers less than this share of the photo (a guess).
const FAR: f64 = 0.1;

/// Whether plants are seen and all of them are small.
pub(crate) fn is_far(maps: &OrganMaps) -> bool {
    let plants = maps.semantic();
    let largest = patches(&plants).into_iter().map(|patch| patch.pixels.len()).max();
    largest.is_some_and(|largest| (largest as f64) < FAR * plants.len() as f64)
}

/// Takes the photo's own colours for what is a plant: what they add is leaf, for a small plant's other organs are not seen.
pub(crate) fn sharpen(semantic: &mut GrayImage, picture: &Rgb, plants: &Mask) {
    let (width, height) = semantic.dimensions();
    let shown = sharpened(&resize(picture, width, height, FilterType::Triangle), plants);
    for (class, inside) in semantic.pixels_mut().zip(shown.pixels()) {
        *class = match (class.0[0] > 0, inside.0[0] > 0) {
            (_, false) => Luma([Semantic::Background as u8]),
            (false, true) => Luma([Semantic::Leaf as u8]),
            (true, true) => *class,
        };
    }
}

#[cfg(test)]
mod tests {
    use image::ImageBuffer;

    use super::*;

    const BRIGHT: [u8; 3] = [60, 140, 50];

    /// Two green discs on soil and a network that is sure of the middle of one, says nothing of its rim nor of the other,
    /// and takes a grey stone for a plant.
    fn field() -> (Rgb, Mask) {
        let within = |x: u32, y: u32, [a, b]: [i32; 2], r: i32| (x as i32 - a).pow(2) + (y as i32 - b).pow(2) < r * r;
        let picture = Rgb::from_fn(200, 200, |x, y| {
            let noise = ((x * 7 + y * 13) % 9) as u8;
            image::Rgb(if within(x, y, [60, 60], 20) || within(x, y, [150, 150], 8) {
                BRIGHT
            } else if within(x, y, [150, 40], 12) {
                [150, 150, 152]
            } else {
                [120 + noise, 100, 80]
            })
        });
        let plants = ImageBuffer::from_fn(200, 200, |x, y| {
            Luma([if within(x, y, [60, 60], 16) {
                0.97
            } else if within(x, y, [150, 40], 12) || within(x, y, [60, 60], 22) || within(x, y, [150, 150], 8) {
                0.6
            } else {
                0.02
            }])
        });
        (picture, plants)
    }

    #[test]
    fn colours_say_what_a_small_plant_is_and_organs_that_were_seen_stay() {
        let (picture, plants) = field();
        let mut semantic = GrayImage::from_fn(200, 200, |x, y| {
            let class = if plants.get_pixel(x, y).0[0] > 0.9 { Semantic::MainStem } else { Semantic::Background };
            Luma([if (30..50).contains(&y) && x > 135 { Semantic::Leaf } else { class } as u8])
        });
        sharpen(&mut semantic, &picture, &plants);
        for (x, y, class) in semantic.enumerate_pixels() {
            let expected = match (plants.get_pixel(x, y).0[0] > 0.9, picture.get_pixel(x, y).0 == BRIGHT) {
                (true, _) => Semantic::MainStem,
                (false, true) => Semantic::Leaf,
                (false, false) => Semantic::Background,
            };
            assert_eq!(class.0[0], expected as u8, "({x}, {y})");
        }
    }
}
