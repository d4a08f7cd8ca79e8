//! The camera of a photo: a calibration file, else what the photo says of its lens, else a guess that is told.

use std::path::Path;

use demeter_frame::{Intrinsics, Rgb};
use exif::{In, Tag};
use image::imageops::{rotate90, rotate180, rotate270};

use crate::error::CommandError;
use crate::files;

/// Horizontal field of view when nothing is known, degrees: between phones (about 65 upright to 70) and the lenses of
/// imaging chambers (about 35). A guess; what depends on it is told in a warning.
const DEFAULT_HFOV_DEGREES: f64 = 50.0;
/// The diagonal of the film that "35 mm equivalent" refers to, millimetres.
const FILM_DIAGONAL_MM: f64 = 43.266_615;
/// Fields of view that a pinhole can have, degrees.
const HFOV_DEGREES: std::ops::RangeInclusive<f64> = 1.0..=170.0;

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

/// The camera of an upright photo.
///
/// # Errors
/// [`CommandError`] (bad use) for a calibration or field of view that no camera has.
pub fn of(
    photo: &Rgb,
    bytes: &[u8],
    turned: bool,
    calibration: Option<&Path>,
    hfov_degrees: Option<f64>,
) -> Result<Lens, CommandError> {
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
        return Ok(Lens { camera, warning: None });
    }
    if let Some(degrees) = hfov_degrees {
        if !HFOV_DEGREES.contains(&degrees) {
            return Err(CommandError::usage("hfov", "--hfov: no camera has that field of view")
                .with("1 to 170 degrees", degrees));
        }
        return Ok(Lens { camera: Intrinsics::from_hfov(width, height, degrees.to_radians()), warning: None });
    }
    let diagonal = f64::from(width).hypot(f64::from(height));
    let f = number(bytes, Tag::FocalLengthIn35mmFilm).filter(|mm| *mm > 1.0).map(|mm| mm / FILM_DIAGONAL_MM * diagonal);
    Ok(match f {
        Some(f) => {
            let hfov = 2.0 * (f64::from(width) / 2.0 / f).atan();
            let warning = format!("focal length from the photo's EXIF: field of view {:.0} degrees", hfov.to_degrees());
            Lens { camera: Intrinsics::from_hfov(width, height, hfov), warning: Some(warning) }
        }
        None => Lens {
            camera: Intrinsics::from_hfov(width, height, DEFAULT_HFOV_DEGREES.to_radians()),
            warning: Some(format!(
                "the photo does not tell its lens: {DEFAULT_HFOV_DEGREES} degrees of horizontal field of view assumed \
                 (--hfov or --calibration)"
            )),
        },
    })
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
