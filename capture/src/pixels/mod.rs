//! From a camera's bytes to pixels: everything is checked against bounds before anything is allocated.

mod error;
mod jpeg;
mod png;
mod raw;

use demeter_frame::{Frame, Intrinsics, PixelFormat, Rgb};

pub use error::DecodeError;

/// The most pixels ever decoded: 16 megapixels, above every rig camera and most phones (12); 48 MB of RGB.
pub const MAX_PIXELS: u64 = 16_000_000;

/// The pixels of a frame, of the size the camera announced.
///
/// # Errors
/// [`DecodeError`], one variant for each kind of damage.
pub fn decode(frame: &Frame) -> Result<Rgb, DecodeError> {
    if frame.bytes.is_empty() {
        return Err(DecodeError::Empty);
    }
    match frame.format {
        PixelFormat::Jpeg => jpeg::decode(&frame.bytes, Some((frame.width, frame.height))),
        _ => raw::decode(frame),
    }
}

/// The pixels of a photo, JPEG or PNG by its first bytes. Transparency is dropped, grey becomes RGB, 16 bits become 8.
///
/// # Errors
/// [`DecodeError`], one variant for each kind of damage.
pub fn decode_photo(bytes: &[u8]) -> Result<Rgb, DecodeError> {
    if bytes.is_empty() {
        Err(DecodeError::Empty)
    } else if bytes.starts_with(png::MAGIC) {
        png::decode(bytes)
    } else {
        jpeg::decode(bytes, None)
    }
}

/// Refuses an empty image and one of more than [`MAX_PIXELS`] or [`Intrinsics::MAX_SIDE`].
fn within_bounds(width: u32, height: u32) -> Result<(), DecodeError> {
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > MAX_PIXELS || width.max(height) > Intrinsics::MAX_SIDE {
        return Err(DecodeError::Oversized { width, height });
    }
    Ok(())
}

/// Callers hand over exactly 3 * width * height bytes.
fn raster(width: u32, height: u32, pixels: Vec<u8>) -> Rgb {
    Rgb::from_raw(width, height, pixels).expect("as many bytes as pixels")
}
