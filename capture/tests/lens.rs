//! A lens that is covered or dirty is told from everything that only looks like it.

use std::path::Path;

use demeter_capture::{Lens, LensWatch, decode_photo};
use demeter_frame::Rgb;
use image::imageops;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;
/// How far the scene goes by from picture to picture, pixels.
const STEP: u32 = 11;
const PICTURES: u32 = 45;

/// A field of patches in three sizes, long enough to drive along.
fn field() -> Rgb {
    let hash = |x: u32, y: u32, size: u32| {
        let seed = [x / size, y / size, size].map(u32::to_le_bytes).concat();
        i32::from(blake3::hash(&seed).as_bytes()[0]) - 128
    };
    Rgb::from_fn(WIDTH + STEP * PICTURES, HEIGHT, |x, y| {
        let luma = 120 + hash(x, y, 40) / 3 + hash(x, y, 7) / 4 + hash(x, y, 2) / 4;
        image::Rgb([luma.clamp(0, 255) as u8; 3])
    })
}

/// What a camera sees that drives along the field with a lens to which `lens` was done; the last states it went through.
fn drive(step: u32, lens: impl Fn(u32, &mut Rgb)) -> Vec<Lens> {
    let (field, mut watch) = (field(), LensWatch::default());
    let pictures = (0..PICTURES).filter_map(|i| {
        let mut picture = imageops::crop_imm(&field, i * step, 0, WIDTH, HEIGHT).to_image();
        lens(i, &mut picture);
        watch.see(u64::from(i) * 1_000_000_000, &picture)
    });
    pictures.collect()
}

/// Smears a disc around that point.
fn smear(picture: &mut Rgb, x: i64, y: i64) {
    let blurred = imageops::blur(picture, 8.0);
    for (at_x, at_y, pixel) in blurred.enumerate_pixels() {
        if (i64::from(at_x) - x).pow(2) + (i64::from(at_y) - y).pow(2) < 50 * 50 {
            picture.put_pixel(at_x, at_y, *pixel);
        }
    }
}

fn fill(picture: &mut Rgb, luma: u8, inside: impl Fn(u32, u32) -> bool) {
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        if inside(x, y) {
            *pixel = image::Rgb([luma; 3]);
        }
    }
}

#[test]
fn a_smear_and_mud_are_found_where_they_are() {
    let mud = |_, picture: &mut Rgb| fill(picture, 20, |x, y| (170..270).contains(&x) && (70..170).contains(&y));
    let smears: [(&str, Vec<Lens>); 2] =
        [("smear", drive(STEP, |_, picture| smear(picture, 220, 120))), ("mud", drive(STEP, mud))];
    for (name, states) in smears {
        let [Lens::Dirty { x, y, share }] = states[..] else { panic!("{name}: {states:?}") };
        assert!((x - 220.0 / 320.0).abs() < 0.05 && (y - 0.5).abs() < 0.08, "{name}: {x} {y}");
        assert!((0.04..0.18).contains(&share), "{name}: {share}");
    }
}

#[test]
fn what_only_looks_like_dirt_is_none() {
    let clear = Vec::<Lens>::new();
    assert_eq!(drive(STEP, |_, _| {}), clear, "a clean lens");
    assert_eq!(drive(0, |_, picture| smear(picture, 220, 120)), clear, "a soft thing before a rig at rest");
    let passing = |i: u32, picture: &mut Rgb| smear(picture, 400 - i64::from(i * STEP), 120);
    assert_eq!(drive(STEP, passing), clear, "a soft thing that goes by");
    assert_eq!(drive(STEP, |_, picture| fill(picture, 230, |_, y| y < 110)), clear, "the sky");
    assert_eq!(drive(STEP, |_, picture| *picture = imageops::blur(picture, 5.0)), clear, "out of focus as a whole");
}

#[test]
fn a_cover_is_noticed_after_seconds_and_its_removal_at_once() {
    for luma in [3, 128, 255] {
        let covered = |i: u32, picture: &mut Rgb| {
            if (10..30).contains(&i) {
                fill(picture, luma, |_, _| true);
            }
        };
        assert_eq!(drive(STEP, covered), [Lens::Covered, Lens::Clear], "luma {luma}");
    }
    let brushed = |i: u32, picture: &mut Rgb| {
        if i % 12 < 9 {
            fill(picture, 3, |_, _| true);
        }
    };
    assert_eq!(drive(STEP, brushed), [], "leaves that brush by");
    let night = |_, picture: &mut Rgb| fill(picture, 3, |x, _| x > 60);
    assert!(!drive(STEP, night).contains(&Lens::Covered), "a lamp in the night");
}

/// The bundled row, rendered as a camera sees it, with and without a thumb's print on the lens.
#[test]
fn a_print_on_the_lens_is_found_before_the_bundled_row() {
    let frames = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/row/frames");
    let mut files: Vec<_> = frames.read_dir().expect("the fixture").map(|entry| entry.expect("reads").path()).collect();
    files.sort();
    for print in [false, true] {
        let mut watch = LensWatch::default();
        // There and back again, since the row is short.
        for (i, file) in files.iter().chain(files.iter().rev()).enumerate() {
            let mut picture = decode_photo(&std::fs::read(file).expect("reads")).expect("decodes");
            if print {
                let blurred = imageops::blur(&imageops::crop_imm(&picture, 200, 260, 180, 180).to_image(), 12.0);
                imageops::replace(&mut picture, &blurred, 200, 260);
            }
            watch.see(i as u64 * 1_000_000_000, &picture);
        }
        assert_eq!(matches!(watch.state(), Lens::Dirty { .. }), print, "{:?}", watch.state());
    }
}
