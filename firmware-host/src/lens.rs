//! The camera of a photo: a calibration file, else what the photo says of its lens, else what the network sees in it;
//! what is not known is told.

use std::path::Path;

use demeter_frame::{Intrinsics, Rgb, Undistort};
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

/// A photo as it is looked at, upright and with straight lines, and its camera: `None` when nobody tells it.
///
/// # Errors
/// [`CommandError`] (bad use) for a calibration or field of view that no camera has.
pub fn of(
    photo: Rgb,
    bytes: &[u8],
    calibration: Option<&Path>,
    hfov_degrees: Option<f64>,
) -> Result<(Rgb, Option<Lens>), CommandError> {
    let turn = Turn::of(bytes);
    if let Some(file) = calibration {
        return calibrated(photo, turn, file).map(|(photo, lens)| (photo, Some(lens)));
    }
    let photo = turn.picture(photo);
    let lens = told(&photo, bytes, hfov_degrees)?;
    Ok((photo, lens))
}

/// The photo straightened and turned, with the camera that would have taken it so.
fn calibrated(photo: Rgb, turn: Turn, file: &Path) -> Result<(Rgb, Lens), CommandError> {
    let calibration = files::calibration(file)?;
    let of = [calibration.intrinsics().width, calibration.intrinsics().height];
    // A calibration is of the sensor, whose picture is turned afterwards, or else of photos that had been turned.
    let turned_before = turn.is_quarter() && of != <[u32; 2]>::from(photo.dimensions());
    let (photo, turn) = if turned_before { (turn.picture(photo), Turn::None) } else { (photo, turn) };
    let (width, height) = photo.dimensions();
    let calibration = calibration.sized(width, height).map_err(|error| {
        let message = format!("{}: {error}", file.display());
        CommandError::usage("calibration", message).with(format!("{width}x{height}"), format!("{}x{}", of[0], of[1]))
    })?;
    let (photo, warning) = match Undistort::of(&calibration) {
        None => (photo, None),
        Some(table) => {
            let straight =
                table.picture(&photo).map_err(|error| CommandError::usage("calibration", &error).of(file))?;
            (straight, Some("the photo was straightened: the camera is that of the straightened photo".into()))
        }
    };
    Ok((turn.picture(photo), Lens { camera: turn.camera(calibration.pinhole()), warning }))
}

/// The camera of an upright photo by its field of view, told or from its EXIF fields.
fn told(photo: &Rgb, bytes: &[u8], hfov_degrees: Option<f64>) -> Result<Option<Lens>, CommandError> {
    let (width, height) = photo.dimensions();
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

/// How a photo is turned to be upright, as its EXIF orientation says; mirrored ones, which no camera takes, are left.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Turn {
    None,
    Half,
    Clockwise,
    Back,
}

impl Turn {
    fn of(bytes: &[u8]) -> Self {
        match number(bytes, Tag::Orientation) {
            Some(3.0) => Self::Half,
            Some(6.0) => Self::Clockwise,
            Some(8.0) => Self::Back,
            _ => Self::None,
        }
    }

    fn is_quarter(self) -> bool {
        matches!(self, Self::Clockwise | Self::Back)
    }

    fn picture(self, photo: Rgb) -> Rgb {
        match self {
            Self::None => photo,
            Self::Half => rotate180(&photo),
            Self::Clockwise => rotate90(&photo),
            Self::Back => rotate270(&photo),
        }
    }

    /// The camera after its picture was turned.
    fn camera(self, k: Intrinsics) -> Intrinsics {
        let (right, down) = (f64::from(k.width) - k.cx, f64::from(k.height) - k.cy);
        let quarter = Intrinsics { width: k.height, height: k.width, fx: k.fy, fy: k.fx, ..k };
        match self {
            Self::None => k,
            Self::Half => Intrinsics { cx: right, cy: down, ..k },
            Self::Clockwise => Intrinsics { cx: down, cy: k.cx, ..quarter },
            Self::Back => Intrinsics { cx: k.cy, cy: right, ..quarter },
        }
    }
}

/// A number among the photo's EXIF fields.
fn number(bytes: &[u8], tag: Tag) -> Option<f64> {
    let exif = exif::Reader::new().read_from_container(&mut std::io::Cursor::new(bytes)).ok()?;
    exif.get_field(tag, In::PRIMARY)?.value.get_uint(0).map(f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pixel's direction before the turn is that of the pixel it becomes, turned likewise.
    #[test]
    fn a_camera_turns_with_its_picture() {
        let k = Intrinsics { width: 8, height: 6, fx: 9.0, fy: 7.0, cx: 3.0, cy: 4.0 };
        let picture = Rgb::from_fn(8, 6, |x, y| image::Rgb([x as u8, y as u8, 0]));
        for (turn, [xx, xy, yx, yy]) in [
            (Turn::None, [1.0, 0.0, 0.0, 1.0]),
            (Turn::Half, [-1.0, 0.0, 0.0, -1.0]),
            (Turn::Clockwise, [0.0, -1.0, 1.0, 0.0]),
            (Turn::Back, [0.0, 1.0, -1.0, 0.0]),
        ] {
            let (turned, camera) = (turn.picture(picture.clone()), turn.camera(k));
            assert_eq!(turned.dimensions(), (camera.width, camera.height));
            for (x, y, pixel) in turned.enumerate_pixels() {
                let ray = |k: &Intrinsics, [x, y]: [u32; 2]| {
                    k.unproject((f64::from(x) + 0.5, f64::from(y) + 0.5).into(), 1.0)
                };
                let before = ray(&k, [pixel.0[0].into(), pixel.0[1].into()]);
                let after = ray(&camera, [x, y]);
                assert!((after.x - (xx * before.x + xy * before.y)).abs() < 1e-12, "{turn:?}");
                assert!((after.y - (yx * before.x + yy * before.y)).abs() < 1e-12, "{turn:?}");
            }
        }
    }
}
