use demeter_frame::{Frame, PixelFormat, Rgb};

use super::{DecodeError, raster, within_bounds};

/// Decodes a raw frame: every row of `stride` bytes must be there, the last up to its last pixel. What stands behind
/// (drivers round up to pages) and between rows is skipped.
///
/// Y, U and V are those of BT.601 in limited range, as USB Video Class 1.5 prescribes for uncompressed video. Thirty lines
/// in place of a crate that brings every other conversion too and takes a minute to build.
pub(super) fn decode(frame: &Frame) -> Result<Rgb, DecodeError> {
    within_bounds(frame.width, frame.height)?;
    let (width, height) = (frame.width as usize, frame.height as usize);
    let (row, stride) = (frame.format.row_bytes(frame.width), frame.stride as usize);
    if stride < row {
        return Err(DecodeError::Stride { expected: row, found: stride });
    }
    let rows = if frame.format == PixelFormat::Nv12 { height + height.div_ceil(2) } else { height };
    let expected = stride * (rows - 1) + row;
    if frame.bytes.len() < expected {
        return Err(DecodeError::Truncated { expected: Some(expected), found: frame.bytes.len() });
    }
    let line = |i: usize| &frame.bytes[i * stride..][..row];
    let mut pixels = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        let from = pixels.len();
        match frame.format {
            PixelFormat::Grey => line(y).iter().for_each(|&luma| pixels.extend([luma; 3])),
            PixelFormat::Yuyv => {
                line(y).as_chunks::<4>().0.iter().for_each(|&[y0, u, y1, v]| pixels.extend(pair([y0, y1], [u, v])));
            }
            PixelFormat::Nv12 => {
                let pairs = line(y).as_chunks::<2>().0.iter().zip(line(height + y / 2).as_chunks::<2>().0);
                pairs.for_each(|(&luma, &chroma)| pixels.extend(pair(luma, chroma)));
            }
            PixelFormat::Rgb24 | PixelFormat::Jpeg => pixels.extend_from_slice(line(y)),
        }
        // An odd width leaves half a pair over.
        pixels.truncate(from + 3 * width);
    }
    Ok(raster(frame.width, frame.height, pixels))
}

/// Two pixels with one colour, by the integer form of BT.601: 8 bits of fraction, rounded, clipped.
fn pair(luma: [u8; 2], chroma: [u8; 2]) -> [u8; 6] {
    let [u, v] = chroma.map(|c| i32::from(c) - 128);
    let [r, g, b] = [409 * v, -100 * u - 208 * v, 516 * u];
    let mut rgb = [0; 6];
    for (pixel, luma) in rgb.chunks_exact_mut(3).zip(luma) {
        let y = 298 * (i32::from(luma) - 16) + 128;
        pixel.copy_from_slice(&[r, g, b].map(|c| ((y + c) >> 8).clamp(0, 255) as u8));
    }
    rgb
}
