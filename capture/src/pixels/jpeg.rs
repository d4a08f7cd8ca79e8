use demeter_frame::Rgb;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

use super::{DecodeError, raster, within_bounds};

/// Passes of a progressive JPEG: encoders write about 10, and each costs as much time as a whole image.
const MAX_SCANS: usize = 32;

/// Decodes strictly (`image` would take half a JPEG for a whole one) and looks at the header before allocating pixels.
pub(super) fn decode(bytes: &[u8], announced: Option<(u32, u32)>) -> Result<Rgb, DecodeError> {
    if !bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        return Err(DecodeError::NotAnImage { found: bytes.iter().take(4).copied().collect() });
    }
    // No limit of the decoder's own on sides: ours, below, names what was found.
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX))
        .jpeg_set_max_scans(MAX_SCANS)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|error| refusal(&error, bytes))?;
    let (width, height) = decoder.info().map_or((0, 0), |info| (u32::from(info.width), u32::from(info.height)));
    within_bounds(width, height)?;
    if let Some(expected) = announced.filter(|&size| size != (width, height)) {
        return Err(DecodeError::Size { expected, found: (width, height) });
    }
    if let Some(colours) = decoder.input_colorspace().filter(|c| !is_decoded(*c)) {
        return Err(DecodeError::Unsupported { found: format!("{colours:?}") });
    }
    if !has_end(bytes) {
        return Err(DecodeError::Truncated { expected: None, found: bytes.len() });
    }
    let pixels = decoder.decode().map_err(|error| refusal(&error, bytes))?;
    Ok(raster(width, height, pixels))
}

fn is_decoded(colours: ColorSpace) -> bool {
    matches!(colours, ColorSpace::Luma | ColorSpace::YCbCr | ColorSpace::RGB)
}

/// True when the last scan (ff da) is followed by the end of the image (ff d9).
///
/// Inside a scan ff is always followed by 00 or a restart, so the pair cannot be pixels. The decoder alone would pass a
/// JPEG that is cut inside its last row of blocks. Cameras pad behind the end, hence the search.
fn has_end(bytes: &[u8]) -> bool {
    let last = bytes.windows(2).rev().find(|pair| matches!(pair, [0xff, 0xd9 | 0xda]));
    last == Some(&[0xff, 0xd9])
}

fn refusal(error: &DecodeErrors, bytes: &[u8]) -> DecodeError {
    match error {
        DecodeErrors::ZeroError => DecodeError::Oversized { width: 0, height: 0 },
        _ if !has_end(bytes) => DecodeError::Truncated { expected: None, found: bytes.len() },
        _ => DecodeError::Damaged { found: error.to_string() },
    }
}
