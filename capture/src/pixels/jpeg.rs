use demeter_frame::Rgb;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

use super::{DecodeError, raster, within_bounds};

/// Passes of a progressive JPEG: encoders write about 10, and each costs as much time as a whole image.
const MAX_SCANS: usize = 32;

/// Bytes the decoder reads ahead: its 64-bit buffer, and as much again to spare.
const READ_AHEAD: usize = 16;

/// Decodes strictly (`image` would take half a JPEG for a whole one) and looks at the header before allocating pixels.
///
/// What still passes: a cut inside the last row of blocks, and missing passes of a progressive JPEG, when an end marker
/// was put behind the cut. Neither is what a cable or a full buffer does.
pub(super) fn decode(bytes: &[u8], announced: Option<(u32, u32)>) -> Result<Rgb, DecodeError> {
    if !bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        return Err(DecodeError::NotAnImage { found: bytes.iter().take(4).copied().collect() });
    }
    let truncated = || DecodeError::Truncated { expected: None, found: bytes.len() };
    let end = end_of_last_scan(bytes);
    let damaged = |error: DecodeErrors| match end {
        None => truncated(),
        Some(_) => DecodeError::Damaged { found: error.to_string() },
    };
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options());
    decoder.decode_headers().map_err(|error| match error {
        DecodeErrors::ZeroError => DecodeError::Oversized { width: 0, height: 0 },
        error => damaged(error),
    })?;
    let Some(header) = decoder.info() else { return Err(truncated()) };
    let (width, height) = (u32::from(header.width), u32::from(header.height));
    within_bounds(width, height)?;
    if let Some(expected) = announced.filter(|&size| size != (width, height)) {
        return Err(DecodeError::Size { expected, found: (width, height) });
    }
    if let Some(colours) = decoder.input_colorspace().filter(|c| !is_decoded(*c)) {
        return Err(DecodeError::Unsupported { found: format!("{colours:?}") });
    }
    let end = end.ok_or_else(truncated)?;
    let pixels = if header.sof.is_sequential_dct() {
        // Behind an end marker the decoder makes up what is missing; without one it refuses to. The zeros are read ahead
        // in the last row of blocks of a whole image.
        let without_end = [&bytes[..end], &[0; READ_AHEAD]].concat();
        JpegDecoder::new_with_options(ZCursor::new(&without_end), options()).decode()
    } else {
        decoder.decode()
    };
    Ok(raster(width, height, pixels.map_err(damaged)?))
}

/// No limit of the decoder's own on sides: [`within_bounds`] names what was found.
fn options() -> DecoderOptions {
    DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX))
        .jpeg_set_max_scans(MAX_SCANS)
        .jpeg_set_out_colorspace(ColorSpace::RGB)
}

fn is_decoded(colours: ColorSpace) -> bool {
    matches!(colours, ColorSpace::Luma | ColorSpace::YCbCr | ColorSpace::RGB)
}

/// Where the end marker (ff d9) behind the last start of scan (ff da) stands.
///
/// Inside a scan ff is always followed by 00 or a restart, so the pairs cannot be pixels. Cameras pad behind the end, so
/// it need not be last.
fn end_of_last_scan(bytes: &[u8]) -> Option<usize> {
    let scan = bytes.windows(2).rposition(|pair| pair == [0xff, 0xda])?;
    bytes[scan..].windows(2).position(|pair| pair == [0xff, 0xd9]).map(|at| scan + at)
}
