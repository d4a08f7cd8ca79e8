use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use demeter_capture::{Cameras, Positions, Source, SourceError, Speed, decode};
use demeter_frame::{Frame, PixelFormat};
use image::ImageFormat;

use super::pick::Pick;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;

/// How long a camera may take to give a picture: it starts its sensor, and is opened again if need be.
const PATIENCE: Duration = Duration::from_secs(15);

/// Frames thrown away first, while exposure and white balance settle (a guess).
const SETTLING: u32 = 5;

/// Arguments of `demeter camera preview`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pick: Pick,
    /// The picture, .jpg or .png; of several cameras, the first gives it.
    #[arg(short, long)]
    output: PathBuf,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let format = match args.output.extension().and_then(|extension| extension.to_str()) {
        Some("jpg" | "jpeg") => ImageFormat::Jpeg,
        Some("png") => ImageFormat::Png,
        _ => {
            let (expected, found) = (".jpg or .png", args.output.display());
            let message = format!("--output: expected {expected}, found {found}");
            return Err(CommandError::usage("usage", message).with(expected, found));
        }
    };
    let mut cameras = args.pick.cameras()?;
    cameras.truncate(1);
    let settings: Vec<_> = cameras.iter().map(|camera| camera.settings(Speed::Given(0.0))).collect::<Result<_, _>>()?;
    let mut source =
        Cameras::open(&settings, &Positions::default()).map_err(|error| CommandError::failed("camera", &error))?;
    let frame = settled(&mut source)?;
    save(&frame, format, &args.output)?;
    if output.json {
        let (camera, path) = (frame.camera, &args.output);
        output
            .json(&serde_json::json!({"camera": camera, "width": frame.width, "height": frame.height, "path": path}))?;
    }
    Ok(Exit::Done)
}

/// The first whole frame after a few.
fn settled(source: &mut Cameras) -> Result<Frame, CommandError> {
    let health = source.health();
    let deadline = Instant::now() + PATIENCE;
    let mut seen = 0;
    while Instant::now() < deadline {
        match source.next() {
            Ok(Some(frame)) if seen >= SETTLING && decode(&frame).is_ok() => return Ok(frame),
            Ok(Some(_)) => seen += 1,
            Ok(None) | Err(SourceError::Quiet | SourceError::Frame(_) | SourceError::Camera(_)) => {}
            Err(error @ SourceError::Lost { .. }) => return Err(CommandError::failed("camera", &error)),
        }
    }
    let why = health.read().into_iter().find_map(|camera| camera.last_error);
    let why = why.unwrap_or_else(|| format!("{seen} frames came and none could be decoded"));
    let message = format!("no picture: {why}");
    Err(CommandError { exit: Exit::Failed, kind: "camera", message, expected: None, found: None })
}

/// A JPEG that is wanted as one is kept as the camera gave it.
fn save(frame: &Frame, format: ImageFormat, path: &Path) -> Result<(), CommandError> {
    if (frame.format, format) == (PixelFormat::Jpeg, ImageFormat::Jpeg) {
        return files::write(path, &frame.bytes);
    }
    let picture = decode(frame).map_err(|error| CommandError::failed("bad_image", &error))?;
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).map_err(|error| CommandError::failed("image", &error))?;
    files::write(path, bytes.get_ref())
}
