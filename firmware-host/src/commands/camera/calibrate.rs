use std::path::{Path, PathBuf};

use demeter_capture::{camera_info, is_id};
use demeter_frame::{Distortion, Intrinsics};
use demeter_recon::calibrate::{BoardView, CalibrateError, Calibrated, calibrate};
use serde::Serialize;

use crate::board::Board;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;

/// Most pictures taken: a bound, ten times what makes a good calibration.
const MOST_PICTURES: usize = 200;
/// Squares along a board's side: fewer give too few corners, more are no board.
const SQUARES: std::ops::RangeInclusive<u32> = 4..=32;

/// Arguments of `demeter camera calibrate`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Pictures of the board, JPEG or PNG, as the camera gives them: ten or more, from near, tilted this way and that, up to
    /// the corners of the picture.
    #[arg(required = true)]
    images: Vec<PathBuf>,
    /// The board's squares along its sides, black and white counted.
    #[arg(long, value_parser = squares, value_name = "COLUMNSxROWS")]
    squares: [u32; 2],
    /// The side of a square, millimetres.
    #[arg(long, value_parser = millimetres)]
    square_mm: f64,
    /// Where the calibration goes: ROS' camera_info, which `calibration` of a camera, `demeter photo` and other programs read.
    #[arg(short, long)]
    output: PathBuf,
}

/// The board in a picture, or why it is left out.
type Look = Result<BoardView, String>;

/// What was found.
#[derive(Serialize)]
struct Summary<'a> {
    calibration: &'a Path,
    intrinsics: Intrinsics,
    distortion: Option<&'a Distortion>,
    /// Standard deviations of fx, fy, cx, cy, pixels, and of the distortion's coefficients.
    deviations: [f64; 9],
    /// Root mean square of how far corners are from where the camera says, pixels.
    rmse_px: f64,
    pictures: Vec<Picture<'a>>,
}

#[derive(Serialize)]
struct Picture<'a> {
    path: &'a Path,
    #[serde(skip_serializing_if = "Option::is_none")]
    rmse_px: Option<f64>,
    /// Between board and sensor, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    tilt_deg: Option<f64>,
    /// Why it was not taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out: Option<String>,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    if args.images.len() > MOST_PICTURES {
        let found = args.images.len();
        let message = format!("expected at most {MOST_PICTURES} pictures, found {found}");
        return Err(CommandError::usage("usage", message).with(MOST_PICTURES, found));
    }
    let board = Board { squares: args.squares, side: args.square_mm / 1e3 };
    let mut size = None;
    let looks: Vec<_> = args.images.iter().map(|path| (path, look(path, &board, &mut size))).collect();
    for (path, look) in &looks {
        if let Err(why) = look {
            tracing::warn!("{}: left out: {why}", path.display());
        }
    }
    let views: Vec<BoardView> = looks.iter().filter_map(|(_, look)| look.as_ref().ok().cloned()).collect();
    let (width, height) = size.unwrap_or_default();
    let calibrated = calibrate(&views, width, height).map_err(|error| refused(&error, &looks))?;

    let stem = args.output.file_stem().and_then(|stem| stem.to_str()).filter(|stem| is_id(stem));
    files::write(&args.output, camera_info(&calibrated.calibration, stem.unwrap_or("camera")).as_bytes())?;
    let mut fitted = calibrated.views.iter();
    let pictures = looks.iter().map(|(path, look)| {
        let view = look.as_ref().ok().and_then(|_| fitted.next());
        let (rmse_px, tilt_deg) = view.map(|view| (view.rmse, view.tilt)).unzip();
        Picture { path, rmse_px, tilt_deg, left_out: look.as_ref().err().cloned() }
    });
    report(args, &calibrated, pictures.collect(), output)?;
    Ok(if views.len() == looks.len() { Exit::Done } else { Exit::Partial })
}

/// The board in a picture, whose size is that of the first that was read, or why it is left out.
fn look(path: &Path, board: &Board, size: &mut Option<(u32, u32)>) -> Look {
    let photo = files::photo(path).map_err(|error| error.message)?;
    let (width, height) = *size.get_or_insert(photo.dimensions());
    let (found_width, found_height) = photo.dimensions();
    if (found_width, found_height) != (width, height) {
        return Err(format!(
            "expected {width}x{height} pixels as the pictures before, found {found_width}x{found_height}"
        ));
    }
    board.find(&photo).map_err(|error| error.to_string())
}

/// Why there is no calibration, with what was wrong with the first picture that was left out.
fn refused(error: &CalibrateError, looks: &[(&PathBuf, Look)]) -> CommandError {
    let left_out = looks.iter().find_map(|(path, look)| Some((path, look.as_ref().err()?)));
    let kind = match error {
        CalibrateError::TooFew { found: 0, .. } => "no_board",
        CalibrateError::TooFew { .. } => "too_few_pictures",
        CalibrateError::Parallel { .. } => "parallel",
        CalibrateError::Loose { .. } => "loose",
        CalibrateError::View { .. } | CalibrateError::Camera(_) => "calibration",
    };
    let mut refused = CommandError::failed(kind, error);
    if let (CalibrateError::TooFew { expected, found }, Some((path, why))) = (error, left_out) {
        refused.message += &format!("; {}: {why}", path.display());
        return refused.with(expected, found);
    }
    refused
}

fn report(
    args: &Args,
    calibrated: &Calibrated,
    pictures: Vec<Picture<'_>>,
    output: &Output,
) -> Result<(), CommandError> {
    let Calibrated { calibration, deviations, rmse, .. } = calibrated;
    if output.json {
        return output.json(&Summary {
            calibration: &args.output,
            intrinsics: *calibration.intrinsics(),
            distortion: calibration.distortion(),
            deviations: *deviations,
            rmse_px: *rmse,
            pictures,
        });
    }
    let mut text = String::new();
    for Picture { path, rmse_px, tilt_deg, .. } in &pictures {
        // Those that were left out have been told in the log.
        if let (Some(rmse), Some(tilt)) = (rmse_px, tilt_deg) {
            text += &format!("{}: {rmse:.2} px, tilted by {tilt:.0} degrees\n", path.display());
        }
    }
    let Intrinsics { width, height, fx, fy, cx, cy } = *calibration.intrinsics();
    let taken = calibrated.views.len();
    text += &format!("{width}x{height} pixels: {rmse:.2} px over {taken} of {} pictures\n", pictures.len());
    let coefficients = calibration.distortion().map_or(&[][..], Distortion::coefficients);
    let numbers = [fx, fy, cx, cy].into_iter().chain(coefficients.iter().copied());
    for (i, (name, number)) in ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"].iter().zip(numbers).enumerate() {
        let decimals = if i < 4 { 2 } else { 5 };
        text += &format!("{name} {number:.decimals$} +- {:.decimals$}\n", deviations[i]);
    }
    output.text(&text)
}

fn squares(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    let sides = sides.filter(|sides| sides.iter().all(|side| SQUARES.contains(side)));
    sides.ok_or_else(|| "expected COLUMNSxROWS of 4 to 32 squares, as 8x6".into())
}

fn millimetres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(mm) if mm > 0.0 && mm <= 1000.0 => Ok(mm),
        _ => Err("expected millimetres above 0, at most 1000".into()),
    }
}
