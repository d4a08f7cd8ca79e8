//! The camera of a photo: a calibration file, else what the photo says of its lens, else what the network sees in it;
//! what is not known is told.

use std::path::Path;

use demeter_frame::{Intrinsics, Rgb};
use demeter_models::CameraGuess;
use exif::{In, Tag};
use image::imageops::{rotate90, rotate180, rotate270};

use crate::error::CommandError;
use crate::files;

/// The diagonal of the film that "35 mm equivalent" refers to, millimetres.
const FILM_DIAGONAL_MM: f64 = 43.266_615;
/// Fields of view that a pinhole can have, degrees.
const HFOV_DEGREES: std::ops::RangeInclusive<f64> = 1.0..=170.0;

/// Fields of view, degrees, that a guess is held to: from a long lens to an action camera (a guess itself).
const GUESSED_DEGREES: (f64, f64) = (10.0, 120.0);

/// A photo's camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// The camera, for the photo's size.
    pub camera: Intrinsics,
    /// What the user should know about where it comes from.
    pub warning: Option<String>,
}

/// Turns a photo as its EXIF orientation says; mirrored ones, which no camera takes, are left. Tells whether width and
/// height changed places.
#[must_use]
pub fn upright(photo: Rgb, bytes: &[u8]) -> (Rgb, bool) {
    match number(bytes, Tag::Orientation) {
        Some(3.0) => (rotate180(&photo), false),
        Some(6.0) => (rotate90(&photo), true),
        Some(8.0) => (rotate270(&photo), true),
        _ => (photo, false),
    }
}

/// The camera of an upright photo, `None` when nobody tells it.
///
/// # Errors
/// [`CommandError`] (bad use) for a calibration or field of view that no camera has.
pub fn of(
    photo: &Rgb,
    bytes: &[u8],
    turned: bool,
    calibration: Option<&Path>,
    hfov_degrees: Option<f64>,
) -> Result<Option<Lens>, CommandError> {
    let (width, height) = photo.dimensions();
    if let Some(path) = calibration {
        let camera = calibrated(path)?;
        // A calibration is of the sensor: it turns with the photo.
        let camera =
            if turned && (camera.width, camera.height) == (height, width) { quarter_turn(camera) } else { camera };
        if (camera.width, camera.height) != (width, height) {
            let message = format!("{}: the calibration is for another picture size", path.display());
            return Err(CommandError::usage("calibration", message)
                .with(format!("{width}x{height}"), format!("{}x{}", camera.width, camera.height)));
        }
        return Ok(Some(Lens { camera, warning: None }));
    }
    if let Some(degrees) = hfov_degrees {
        if !HFOV_DEGREES.contains(&degrees) {
            return Err(CommandError::usage("hfov", "--hfov: no camera has that field of view")
                .with("1 to 170 degrees", degrees));
        }
        let camera = Intrinsics::from_hfov(width, height, degrees.to_radians());
        return Ok(Some(Lens { camera, warning: None }));
    }
    let diagonal = f64::from(width).hypot(f64::from(height));
    let f = number(bytes, Tag::FocalLengthIn35mmFilm).filter(|mm| *mm > 1.0).map(|mm| mm / FILM_DIAGONAL_MM * diagonal);
    Ok(f.map(|f| {
        let hfov = 2.0 * (f64::from(width) / 2.0 / f).atan();
        let warning = format!("focal length from the photo's EXIF: field of view {:.0} degrees", hfov.to_degrees());
        Lens { camera: Intrinsics::from_hfov(width, height, hfov), warning: Some(warning) }
    }))
}

/// The camera as the network sees it in the photo.
#[must_use]
pub fn guessed(photo: &Rgb, guess: &CameraGuess) -> Lens {
    let (width, height) = photo.dimensions();
    let degrees = guess.hfov.to_degrees().clamp(GUESSED_DEGREES.0, GUESSED_DEGREES.1);
    let warning = format!(
        "the photo does not tell its lens: {degrees:.0} degrees of horizontal field of view, give or take {:.0} %, guessed \
         from what it shows (--hfov or --calibration)",
        100.0 * guess.hfov_spread
    );
    Lens { camera: Intrinsics::from_hfov(width, height, degrees.to_radians()), warning: Some(warning) }
}

fn calibrated(path: &Path) -> Result<Intrinsics, CommandError> {
    let bad = |message: String| CommandError::usage("calibration", format!("{}: {message}", path.display()));
    let bytes = files::read(path)?;
    let camera: Intrinsics = serde_json::from_slice(&bytes).map_err(|error| bad(error.to_string()))?;
    camera.validated().map_err(|error| bad(error.to_string()))
}

/// The camera after its picture was turned a quarter; which way matters to the centre by less than lenses are centred.
fn quarter_turn(k: Intrinsics) -> Intrinsics {
    Intrinsics { width: k.height, height: k.width, fx: k.fy, fy: k.fx, cx: k.cy, cy: k.cx }
}

/// A number among the photo's EXIF fields.
fn number(bytes: &[u8], tag: Tag) -> Option<f64> {
    let exif = exif::Reader::new().read_from_container(&mut std::io::Cursor::new(bytes)).ok()?;
    exif.get_field(tag, In::PRIMARY)?.value.get_uint(0).map(f64::from)
}
