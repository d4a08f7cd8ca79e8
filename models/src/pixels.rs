//! Between pictures and arrays: what every adapter does before and after its network.

use std::borrow::Cow;

use demeter_frame::Rgb;
use image::imageops::{FilterType, resize};
use image::{ImageBuffer, Luma};
use ndarray::{Array3, ArrayView2};

use crate::{Manifest, ModelError};

/// Mean and standard deviation of ImageNet's channels, of values in 0..=1: the pixels that most networks know.
pub(crate) const IMAGENET: ([f32; 3], [f32; 3]) = ([0.485, 0.456, 0.406], [0.229, 0.224, 0.225]);

/// The longest side that a graph may fix for its pictures, pixels: memory grows with its square, and no network of
/// these layouts was made for more than 1333 (a guess with room above).
const MAX_SIDE: i64 = 2048;

/// Height and width of the picture that a graph asks for, `None` where it leaves them open.
pub(crate) fn fixed_sides(manifest: &Manifest, multiple: i64) -> Result<[Option<u32>; 2], ModelError> {
    let shape = manifest.inputs.first().map_or(&[][..], |port| &port.shape);
    let side = |axis: usize| match shape.get(axis) {
        Some(&side) if side >= 0 && (side == 0 || side > MAX_SIDE || side % multiple != 0) => {
            let expected = format!("sides that are multiples of {multiple} up to {MAX_SIDE}");
            Err(ModelError::Ports { name: manifest.name.clone(), expected, found: format!("{shape:?}") })
        }
        Some(&side) => Ok(u32::try_from(side).ok()),
        None => Ok(None),
    };
    Ok([side(2)?, side(3)?])
}

/// A picture's width and height.
pub(crate) fn dimensions(image: &Rgb) -> Result<(u32, u32), ModelError> {
    match image.dimensions() {
        (width, height) if width == 0 || height == 0 => Err(ModelError::EmptyImage { width, height }),
        dimensions => Ok(dimensions),
    }
}

/// The picture at another size. Filters widen with the step when they shrink, so that every pixel counts, as Pillow's
/// do; [`FilterType::Triangle`] is its bilinear, [`FilterType::CatmullRom`] its bicubic.
pub(crate) fn resized(image: &Rgb, (w, h): (u32, u32), filter: FilterType) -> Cow<'_, Rgb> {
    if image.dimensions() == (w, h) { Cow::Borrowed(image) } else { Cow::Owned(resize(image, w, h, filter)) }
}

/// A picture as `[3, h, w]`, each value (0..=255) of each channel of RGB as `number` makes it.
pub(crate) fn planes(image: &Rgb, number: impl Fn(usize, f32) -> f32) -> Array3<f32> {
    let (w, h) = image.dimensions();
    let mut planes = Array3::zeros((3, h as usize, w as usize));
    for (channel, mut plane) in planes.outer_iter_mut().enumerate() {
        for (value, pixel) in plane.iter_mut().zip(image.pixels()) {
            *value = number(channel, f32::from(pixel.0[channel]));
        }
    }
    planes
}

/// A channel's value (0..=1) as [`IMAGENET`] has it.
pub(crate) fn imagenet(channel: usize, value: f32) -> f32 {
    let (mean, deviation) = IMAGENET;
    (value - mean[channel]) / deviation[channel]
}

/// A map's value at continuous coordinates, its pixels' centres at halves: between them linearly, and beyond the
/// outermost as there.
pub(crate) fn bilinear(map: ArrayView2<'_, f32>, x: f32, y: f32) -> f32 {
    let (height, width) = map.dim();
    // Beyond the centres of the outermost pixels nothing changes.
    let place = |at: f32, side: usize| {
        let at = (at - 0.5).clamp(0.0, (side - 1) as f32);
        let low = at.floor();
        (low as usize, (low as usize + 1).min(side - 1), at - low)
    };
    let ((x0, x1, u), (y0, y1, v)) = (place(x, width), place(y, height));
    let row = |y: usize| map[[y, x0]] * (1.0 - u) + map[[y, x1]] * u;
    row(y0) * (1.0 - v) + row(y1) * v
}

/// A whole map stretched over a picture. (`image`'s own resizing keeps numbers within 0..=1, which metres are not.)
pub(crate) fn stretched(map: ArrayView2<'_, f32>, (width, height): (u32, u32)) -> ImageBuffer<Luma<f32>, Vec<f32>> {
    let (h, w) = map.dim();
    let (sx, sy) = (w as f32 / width as f32, h as f32 / height as f32);
    ImageBuffer::from_fn(width, height, |x, y| Luma([bilinear(map, (x as f32 + 0.5) * sx, (y as f32 + 0.5) * sy)]))
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn bilinear_keeps_centres_ramps_and_edges() {
        let map = array![[0.0, 10.0, 20.0], [100.0, 110.0, 120.0]];
        for (x, y, expected) in
            [(0.5, 0.5, 0.0), (2.5, 1.5, 120.0), (1.0, 0.5, 5.0), (1.5, 1.0, 60.0), (-9.0, 9.0, 100.0)]
        {
            assert_eq!(bilinear(map.view(), x, y), expected, "{x}, {y}");
        }
        let same = stretched(map.view(), (3, 2));
        assert_eq!(same.as_raw(), &[0.0, 10.0, 20.0, 100.0, 110.0, 120.0]);
        let wide = stretched(map.view(), (6, 2));
        assert_eq!(&wide.as_raw()[..6], &[0.0, 2.5, 7.5, 12.5, 17.5, 20.0]);
    }

    #[test]
    fn planes_keep_channels_and_shrinking_keeps_means() {
        let image = Rgb::from_fn(128, 64, |x, y| image::Rgb([(x * 2 % 256) as u8, 100, (y * 4 % 256) as u8]));
        let planes = planes(&resized(&image, (64, 32), FilterType::Triangle), |_, value| value);
        assert_eq!(planes.shape(), [3, 32, 64]);
        for (plane, expected) in planes.outer_iter().zip([127.0, 100.0, 126.0]) {
            let mean = plane.mean().unwrap();
            assert!((mean - expected).abs() < 1.0, "{mean}, not {expected}");
        }
    }
}
