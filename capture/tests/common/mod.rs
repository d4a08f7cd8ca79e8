//! Pictures, frames and sessions that the tests of this crate share.

#![allow(dead_code, reason = "each test binary uses a part")]

use demeter_capture::{Manifest, Row, SCHEMA_VERSION, SessionCamera};
use demeter_frame::{CameraId, Frame, Intrinsics, PixelFormat, Pose, Rgb, Stamp};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

pub(crate) const WIDTH: u32 = 96;
pub(crate) const HEIGHT: u32 = 64;

/// Blocks of 4 x 4 pixels in colours that depend on the seed: sharp, well exposed, and never the same twice.
pub(crate) fn picture(seed: u64) -> Rgb {
    Rgb::from_fn(WIDTH, HEIGHT, |x, y| {
        let hash = blake3::hash(&[seed.to_le_bytes(), u64::from(x / 4 * 1000 + y / 4).to_le_bytes()].concat());
        let [r, g, b, ..] = *hash.as_bytes();
        image::Rgb([r / 2 + 40, g / 2 + 60, b / 2 + 20])
    })
}

/// The picture as a camera sends it.
pub(crate) fn jpeg(image: &Rgb) -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 90).encode_image(image).expect("encodes");
    bytes
}

pub(crate) fn png(image: &Rgb) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (width, height) = image.dimensions();
    PngEncoder::new(&mut bytes).write_image(image, width, height, ExtendedColorType::Rgb8).expect("encodes");
    bytes
}

/// A good frame of the camera `left`: number 1000 + i, 33 ms after the one before.
pub(crate) fn frame(i: u64) -> Frame {
    Frame {
        camera: CameraId("left".into()),
        seq: 1000 + i,
        stamp: Stamp {
            mono_ns: 5_000_000_000 + i * 33_000_000,
            wall: "2026-06-01T10:00:00Z".into(),
            boot_id: "session-1".into(),
        },
        format: PixelFormat::Jpeg,
        width: WIDTH,
        height: HEIGHT,
        stride: 0,
        bytes: jpeg(&picture(i)).into(),
        world_from_camera: None,
    }
}

pub(crate) fn manifest() -> Manifest {
    let camera = |id: &str| SessionCamera {
        id: CameraId(id.into()),
        height_above_ground_m: Some(1.2),
        intrinsics: Intrinsics::from_hfov(WIDTH, HEIGHT, 1.0),
        distortion: None,
        rig_from_camera: Some(Pose::IDENTITY),
    };
    Manifest {
        schema_version: SCHEMA_VERSION,
        rig_id: "rig-7".into(),
        session_id: "session-1".into(),
        species: "soybean".into(),
        cameras: vec![camera("left"), camera("right")],
        cameras_from_antenna_m: None,
        rows: vec![Row { row: "12".into(), plot: Some("Süd 3/4".into()), plant_spacing_m: Some(0.06) }],
    }
}
