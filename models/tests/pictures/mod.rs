//! Pictures whose every pixel is known.

use demeter_frame::Rgb;

/// A picture whose colours are a ramp to the right, one down and a pattern.
pub(crate) fn ramps(width: u32, height: u32) -> Rgb {
    Rgb::from_fn(width, height, |x, y| {
        image::Rgb([(x * 255 / (width - 1)) as u8, (y * 255 / (height - 1)) as u8, ((x + y) % 200) as u8])
    })
}
