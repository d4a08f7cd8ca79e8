//! Pixels come out as they went in, and no part of an image passes for the whole.

use demeter_capture::{DecodeError, MAX_PIXELS, decode, decode_photo};
use demeter_frame::{Frame, PixelFormat, Rgb};
use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, GrayImage, ImageFormat, Luma};
use proptest::prelude::*;

mod common;
use common::{HEIGHT, WIDTH, frame, jpeg, picture, png};

/// Mean absolute difference a channel, 0 to 255.
fn difference(a: &Rgb, b: &Rgb) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let sum: u64 = a.iter().zip(b.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.len() as f64
}

#[test]
fn colour_and_grey_come_back() {
    // Quality 90 with full chroma keeps flat 4 x 4 blocks within a few grey levels.
    let decoded = decode(&frame(7)).expect("decodes");
    assert!(difference(&decoded, &picture(7)) < 6.0, "{}", difference(&decoded, &picture(7)));
    assert!(difference(&decoded, &picture(8)) > 20.0, "another picture is told apart");

    let grey = GrayImage::from_fn(WIDTH, HEIGHT, |x, y| Luma([(x * 2 + y) as u8]));
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 90).encode_image(&grey).expect("encodes");
    let decoded = decode(&Frame { bytes: bytes.into(), ..frame(0) }).expect("decodes");
    assert!(decoded.pixels().all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2]));
    assert!(difference(&decoded, &DynamicImage::from(grey).into_rgb8()) < 2.0);
}

#[test]
fn no_part_of_a_jpeg_passes_for_the_whole() {
    let good = frame(3);
    for len in 0..good.bytes.len() {
        assert!(decode(&Frame { bytes: good.bytes[..len].into(), ..good.clone() }).is_err(), "the first {len} bytes");
    }
    let mut padded = good.bytes.to_vec();
    padded.extend([0; 1000]);
    assert!(decode(&Frame { bytes: padded.into(), ..good.clone() }).is_ok(), "cameras pad behind the end");
    // The control: a lenient decoder takes half for the whole, which is why this crate has its own.
    #[expect(clippy::disallowed_methods, reason = "it is the control")]
    let lenient = image::load_from_memory(&good.bytes[..good.bytes.len() / 2]);
    assert!(lenient.is_ok());
}

#[test]
fn bombs_are_refused_by_their_header_alone() {
    let good = jpeg(&picture(1));
    let sof = good.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame header");
    let scan = good.windows(2).position(|w| w == [0xff, 0xda]).expect("a scan");
    let mut bomb = good[..scan + 14].to_vec();
    bomb[sof + 5..sof + 9].copy_from_slice(&[0xff; 4]);
    for refused in [decode_photo(&bomb), decode(&Frame { bytes: bomb.clone().into(), ..frame(1) })] {
        assert!(matches!(refused, Err(DecodeError::Oversized { width: 65_535, height: 65_535 })), "{refused:?}");
    }
    let mut bomb = png(&picture(1));
    bomb.truncate(33);
    bomb[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    // The header's checksum (bytes 29 to 32) is of type and data.
    let crc = crc32(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&crc.to_be_bytes());
    bomb.extend(*b"\0\0\0\x04IDAT\0\0\0\0");
    let refused = decode_photo(&bomb);
    assert!(matches!(refused, Err(DecodeError::Oversized { width: 16_384, height: 16_384 })), "{refused:?}");
    assert!(u64::from(16_384u32).pow(2) > MAX_PIXELS);
}

/// The checksum of PNG chunks (PNG specification, annex D), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// The colours that BT.601's own matrix makes of the primaries in limited range (Y, U, V), pure to three in 255.
#[test]
fn colours_come_back_from_yuv() {
    for ([y, u, v], expected) in [
        ([81, 90, 240], [255, 0, 0]),
        ([145, 54, 34], [0, 255, 0]),
        ([41, 240, 110], [0, 0, 255]),
        ([235, 128, 128], [255, 255, 255]),
        ([16, 128, 128], [0, 0, 0]),
    ] {
        let of = |format, stride, bytes: Vec<u8>| {
            decode(&Frame { format, width: 2, height: 2, stride, bytes: bytes.into(), ..frame(0) }).expect("decodes")
        };
        let yuyv = of(PixelFormat::Yuyv, 4, [y, u, y, v, y, u, y, v].to_vec());
        assert_eq!(yuyv, of(PixelFormat::Nv12, 2, [y, y, y, y, u, v].to_vec()));
        for pixel in yuyv.pixels() {
            assert!(pixel.0.iter().zip(expected).all(|(found, e): (&u8, u8)| found.abs_diff(e) <= 3), "{pixel:?}");
        }
    }
}

#[test]
fn photos_are_told_by_their_first_bytes() {
    let same = |bytes: &[u8]| difference(&decode_photo(bytes).expect("decodes"), &picture(5));
    assert_eq!(same(&png(&picture(5))), 0.0);
    assert!(same(&jpeg(&picture(5))) < 6.0);
    for image in [
        DynamicImage::from(DynamicImage::from(picture(5)).into_rgba8()),
        DynamicImage::from(DynamicImage::from(picture(5)).into_rgb16()),
    ] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Png).expect("encodes");
        assert_eq!(same(bytes.get_ref()), 0.0);
    }
    let whole = png(&picture(5));
    for len in (0..whole.len() - 12).step_by(97) {
        assert!(decode_photo(&whole[..len]).is_err(), "the first {len} bytes");
    }
    assert!(matches!(decode_photo(b"GIF89a"), Err(DecodeError::NotAnImage { .. })));
    assert!(matches!(decode_photo(b""), Err(DecodeError::Empty)));
}

proptest! {
    /// Padding between rows is skipped, whatever stands there.
    #[test]
    fn raw_rows_come_back(width in 1u32..20, height in 1u32..20, gap in 0u32..9, fill in any::<u8>()) {
        let image = Rgb::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 200]));
        let mut bytes = Vec::new();
        for row in image.chunks(width as usize * 3) {
            bytes.extend_from_slice(row);
            bytes.extend(std::iter::repeat_n(fill, gap as usize));
        }
        bytes.truncate(bytes.len() - gap as usize);
        let frame = Frame {
            format: PixelFormat::Rgb24, width, height, stride: width * 3 + gap, bytes: bytes.into(), ..frame(0)
        };
        prop_assert_eq!(decode(&frame).expect("decodes"), image);
    }

    /// Grey pictures through each layout, whatever the padding: what is grey has neither U nor V.
    #[test]
    fn grey_pictures_come_back_from_every_raw_format(
        width in 1u32..20, height in 1u32..20, gap in 0u32..9, seed in any::<u8>()
    ) {
        let grey = |x: u32, y: u32| (x * 7 + y * 13) as u8 ^ seed;
        // Luma of BT.601 in limited range, 16 to 235.
        let luma = |x, y| (16.0 + 219.0 / 255.0 * f64::from(grey(x, y))).round() as u8;
        for format in [PixelFormat::Yuyv, PixelFormat::Nv12, PixelFormat::Grey] {
            let stride = format.row_bytes(width) as u32 + gap;
            let rows = if format == PixelFormat::Nv12 { height + height.div_ceil(2) } else { height };
            let bytes = (0..rows).flat_map(|y| (0..stride).map(move |at| (at, y))).map(|(at, y)| match format {
                PixelFormat::Grey => grey(at, y),
                PixelFormat::Yuyv if at % 2 == 0 => luma(at / 2, y),
                PixelFormat::Nv12 if y < height => luma(at, y),
                _ => 128,
            });
            let bytes: Vec<u8> = bytes.collect();
            let decoded = decode(&Frame { format, width, height, stride, bytes: bytes.into(), ..frame(0) });
            for (x, y, pixel) in decoded.expect("decodes").enumerate_pixels() {
                prop_assert!(pixel.0.iter().all(|c| c.abs_diff(grey(x, y)) <= 1), "{format} {x} {y}: {pixel:?}");
            }
        }
    }

    /// Damage gives an image or an error, never a panic.
    #[test]
    fn damaged_images_do_not_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12)) {
        for mut bytes in [jpeg(&picture(9)), png(&picture(9))] {
            for (at, value) in &edits {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            if let Ok(image) = decode_photo(&bytes) {
                prop_assert!(u64::from(image.width()) * u64::from(image.height()) <= MAX_PIXELS);
            }
        }
    }

    /// Damage to the headers, where the lengths and tables are.
    #[test]
    fn damaged_headers_do_not_panic(edits in prop::collection::vec((0usize..640, any::<u8>()), 1..4)) {
        let mut bytes = jpeg(&picture(9));
        for (at, value) in edits {
            bytes[at] = value;
        }
        if let Ok(image) = decode_photo(&bytes) {
            prop_assert!(image.width() > 0);
        }
    }
}
