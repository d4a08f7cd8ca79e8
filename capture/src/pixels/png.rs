use std::io::Cursor;

use demeter_frame::Rgb;
use image::codecs::png::PngDecoder;
use image::error::ImageError;
use image::{DynamicImage, ImageDecoder, Limits};

use super::{DecodeError, MAX_PIXELS, within_bounds};

/// What every PNG begins with.
pub(super) const MAGIC: &[u8] = b"\x89PNG";

/// Bytes the decoder may hold: [`MAX_PIXELS`] in 16-bit RGBA and as much again for its own rows and tables.
const MAX_ALLOC: u64 = MAX_PIXELS * 8 * 2;

pub(super) fn decode(bytes: &[u8]) -> Result<Rgb, DecodeError> {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_ALLOC);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(|error| refusal(&error, bytes))?;
    let (width, height) = decoder.dimensions();
    within_bounds(width, height)?;
    let image = DynamicImage::from_decoder(decoder).map_err(|error| refusal(&error, bytes))?;
    Ok(image.into_rgb8())
}

fn refusal(error: &ImageError, bytes: &[u8]) -> DecodeError {
    match error {
        ImageError::Unsupported(what) => DecodeError::Unsupported { found: what.to_string() },
        _ if !bytes.windows(4).any(|chunk| chunk == b"IEND") => {
            DecodeError::Truncated { expected: None, found: bytes.len() }
        }
        _ => DecodeError::Damaged { found: error.to_string() },
    }
}
