//! Rasters at another size.

use image::{ImageBuffer, Pixel};

/// Each pixel the one that its centre lies in. (`image`'s own resizing keeps numbers within 0..=1, which depths are
/// not.)
pub(crate) fn nearest<P: Pixel>(
    raster: &ImageBuffer<P, Vec<P::Subpixel>>,
    width: u32,
    height: u32,
) -> ImageBuffer<P, Vec<P::Subpixel>> {
    let (w, h) = raster.dimensions();
    ImageBuffer::from_fn(width, height, |x, y| {
        *raster.get_pixel((2 * x + 1) * w / (2 * width), (2 * y + 1) * h / (2 * height))
    })
}

#[cfg(test)]
mod tests {
    use demeter_frame::Depth;

    use super::*;

    #[test]
    fn nearest_keeps_values_and_places() {
        let raster = Depth::from_raw(3, 1, vec![-5.0, f32::NAN, 7e9]).unwrap_or_default();
        let wide = nearest(&raster, 6, 2);
        assert_eq!(wide.get_pixel(1, 1).0, [-5.0]);
        assert!(wide.get_pixel(2, 0).0[0].is_nan());
        assert_eq!(wide.get_pixel(5, 1).0, [7e9]);
        assert_eq!(nearest(&nearest(&raster, 9, 3), 3, 1).get_pixel(2, 0).0, [7e9]);
    }
}
