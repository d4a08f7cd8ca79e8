//! `demeter photo`: the plants of one photograph.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use demeter_capture::decode_photo;
use demeter_frame::{Intrinsics, Pose, Rgb};
use demeter_recon::model::Species;

use crate::config::{Config, ModelsConfig};
use crate::error::{CommandError, Exit, chain};
use crate::eye::{Eye, Sight, SightError};
use crate::files;
use crate::lens::{self, Lens};
use crate::output::Output;
use crate::picture::{draw_over, png};
use crate::portrait::{self, Portrait, PortraitError};
use crate::reconstruct::ReconstructError;
use crate::report::Document;

/// Most plants reported of one photo, the largest first: fields of hundreds of specks end somewhere.
const MAX_PLANTS: usize = 64;

/// Arguments of `demeter photo`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The photo, JPEG or PNG.
    image: PathBuf,
    /// The configuration, whose `[models]` names the networks; without it /etc/demeter/demeter.toml where there is one.
    #[arg(long)]
    config: Option<PathBuf>,
    /// The species it shows.
    #[arg(long, default_value = "soybean")]
    species: String,
    /// The camera's calibration: Kalibr's camchain (one camera of several as FILE#cam1), ROS' camera_info, OpenCV's YAML, or
    /// JSON with width, height, fx, fy, cx, cy in pixels. The photo of a lens that bends is straightened first.
    #[arg(long, conflicts_with = "hfov")]
    calibration: Option<PathBuf>,
    /// The camera's horizontal field of view, degrees.
    #[arg(long, value_parser = clap::value_parser!(f64))]
    hfov: Option<f64>,
    /// Where the record goes; with --all a folder.
    #[arg(short = 'o', value_name = "OUT")]
    out: Option<PathBuf>,
    /// All plants, not the largest alone.
    #[arg(long)]
    all: bool,
    /// Where the largest plant's mesh goes: .ply, .obj or .glb.
    #[arg(long)]
    mesh: Option<PathBuf>,
    /// Where the photo with the fitted plants drawn over it goes: a PNG.
    #[arg(long)]
    overlay: Option<PathBuf>,
}

/// Reconstructs the largest plant of a photo, or all of them.
///
/// # Errors
/// [`CommandError`] with kind `no_plant` when there is none, else naming what is wrong with the photo or the camera.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let started = Instant::now();
    let species = files::species(&args.species)?;
    let bytes = files::read(&args.image)?;
    let photo = decode_photo(&bytes).map_err(|error| CommandError::failed("bad_image", &error))?;
    let (photo, told) = lens::of(photo, &bytes, args.calibration.as_deref(), args.hfov)?;

    let config = Config::load(args.config.as_deref())?;
    let mut eye = Eye::of_photos(&config.models, NonZeroUsize::MIN)?;
    let blind = |error: SightError| CommandError::failed(error.name(), &error);
    let maps = eye.maps(&photo).map_err(blind)?;
    let Lens { camera, warning } = told.unwrap_or_else(|| lens::guessed(&photo, &maps.camera));
    let mut warnings: Vec<String> = warning.into_iter().collect();
    warnings.extend(eye.degraded().iter().map(ToString::to_string));
    // Who brings networks of their own wants to see what those find.
    let as_silhouette = !args.all && config.models == ModelsConfig::default();
    let one = if as_silhouette { portrait::grass(&mut eye, &photo, &camera, &species) } else { Ok(None) };
    let (mut fitted, failures) = match one {
        Ok(Some(portrait)) => (vec![portrait], 0),
        Ok(None) | Err(PortraitError::Reconstruct(_)) => {
            let sight = eye.look_with(&photo, maps, &camera, None).map_err(blind)?;
            all(args, sight, &camera, &species, &mut warnings)?
        }
        Err(PortraitError::Sight(error)) => return Err(CommandError::failed(error.name(), &error)),
    };
    write(args, &mut fitted, &species, &photo, &camera)?;
    let plants = fitted.into_iter().map(|plant| plant.described.report).collect();
    let exit = if args.all && failures > 0 { Exit::Partial } else { Exit::Done };
    output.plants(&Document { plants, warnings, seconds: Some(started.elapsed().as_secs_f64()) })?;
    Ok(exit)
}

/// Every plant seen, by its organs, the largest first, or the largest that can be fitted; and how many could not.
fn all(
    args: &Args,
    sight: Sight,
    camera: &Intrinsics,
    species: &Species,
    warnings: &mut Vec<String>,
) -> Result<(Vec<Portrait>, usize), CommandError> {
    warnings.extend(sight.degraded.iter().map(ToString::to_string));
    let (scale_source, mut seen) = (sight.scale_source, sight.plants);
    if seen.is_empty() {
        let organs = sight.refused.iter().map(|r| r.instances.len()).sum::<usize>();
        let why = sight.refused.first().map_or_else(|| "no organ large enough".into(), |r| r.reason.to_string());
        return Err(CommandError {
            exit: Exit::Failed,
            kind: "no_plant",
            message: format!("{}: no plant found: {why}", args.image.display()),
            expected: Some("a plant with a leaf".into()),
            found: Some(format!("{organs} organs and {} scraps", sight.dropped.len())),
        });
    }
    if seen.len() > MAX_PLANTS {
        warnings.push(format!("{} plants seen, the {MAX_PLANTS} largest kept", seen.len()));
        seen.truncate(MAX_PLANTS);
    }

    let mut fitted = Vec::new();
    let mut failures: Vec<ReconstructError> = Vec::new();
    for sight in seen {
        match Portrait::of(sight, species, camera, scale_source) {
            Ok(plant) => fitted.push(plant),
            Err(error) => {
                warnings.push(format!("a plant could not be fitted: {}", chain(&error)));
                failures.push(error);
            }
        }
        if !args.all && !fitted.is_empty() {
            break;
        }
    }
    if let (true, Some(error)) = (fitted.is_empty(), failures.first()) {
        return Err(CommandError::failed(error.name(), error));
    }
    Ok((fitted, failures.len()))
}

fn write(
    args: &Args,
    fitted: &mut [Portrait],
    species: &Species,
    photo: &Rgb,
    camera: &Intrinsics,
) -> Result<(), CommandError> {
    if let Some(out) = &args.out {
        if args.all {
            std::fs::create_dir_all(out).map_err(|error| CommandError::failed("file", &error))?;
        }
        for (i, plant) in fitted.iter_mut().enumerate() {
            let path = if args.all { out.join(format!("plant-{:03}.dmtr", i + 1)) } else { out.clone() };
            files::write(&path, &plant.described.record)?;
            plant.described.report.record = Some(path.display().to_string());
        }
    }
    if let (Some(path), Some(largest)) = (&args.mesh, fitted.first()) {
        files::write_mesh(path, &largest.described.plant, species)?;
    }
    if let Some(path) = &args.overlay {
        write_overlay(path, fitted, species, photo, camera)?;
    }
    Ok(())
}

fn write_overlay(
    path: &Path,
    fitted: &[Portrait],
    species: &Species,
    photo: &Rgb,
    camera: &Intrinsics,
) -> Result<(), CommandError> {
    let mut drawn = photo.clone();
    // The largest plant is drawn last, over the others.
    for plant in fitted.iter().rev() {
        drawn = draw_over(&drawn, camera, &plant.in_camera, species, Pose::IDENTITY)
            .map_err(|error| CommandError::failed("overlay", &error))?;
    }
    files::write(path, &png(&drawn).map_err(|error| CommandError::failed("overlay", &error))?)
}
