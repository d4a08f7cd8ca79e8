use std::path::PathBuf;

use demeter_frame::{Intrinsics, Pinhole, Pose};
use demeter_recon::model::Detail;
use demeter_recon::organs::ScaleSource;
use demeter_recon::record::encode_exact;
use demeter_recon::world::{Scene, Sensor, Setting, grow, render, seeded};
use glam::DVec3;

use super::unit_interval;
use crate::describe::report;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::picture::png;
use crate::report::Document;

/// Arguments of `demeter synth plant`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// soybean, maize or another species that ships.
    #[arg(long, default_value = "soybean")]
    species: String,
    /// 0 = the first true leaf, 1 = full height.
    #[arg(long, default_value_t = 0.3, value_parser = unit_interval)]
    age: f64,
    /// The same seed gives the same plant.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The exact record.
    #[arg(short, long)]
    output: PathBuf,
    /// Also write the plant's surface: .ply, .obj or .glb.
    #[arg(long)]
    mesh: Option<PathBuf>,
    /// Also write a picture of it from the side: .png.
    #[arg(long)]
    picture: Option<PathBuf>,
}

/// Side of the picture, pixels.
const PICTURE_SIDE: u32 = 640;

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let failed = |error: &dyn std::error::Error| CommandError::failed("world", error);
    let species = files::species(&args.species)?;
    let plant = grow(&species, args.age, &mut seeded(args.seed));
    let record = encode_exact(&plant, &species, ScaleSource::Input).map_err(|error| failed(&error))?;
    files::write(&args.output, &record)?;
    if let Some(path) = &args.mesh {
        files::write_mesh(path, &plant, &species)?;
    }
    let mut report = report(&plant, &species, record.len(), ScaleSource::Input)?;
    report.record = Some(args.output.display().to_string());
    if let Some(path) = &args.picture {
        let scene = Scene::new(vec![(&species, plant)], Setting::STUDIO, Detail::Control, args.seed)
            .map_err(|error| failed(&error))?;
        let (low, high) = scene.bounds();
        let (middle, reach) = (f64::from((low + high).z) * 0.5, f64::from((high - low).max_element()));
        // 40 degrees show 0.73 of the distance; a margin is left.
        let eye = DVec3::new(0.0, -1.6 * reach, middle + 0.25 * reach);
        let camera = Pinhole {
            intrinsics: Intrinsics::from_hfov(PICTURE_SIDE, PICTURE_SIDE, 40f64.to_radians()),
            world_from_camera: Pose::looking_at(eye, DVec3::Z * middle, DVec3::Z),
        };
        let sensor = Sensor { samples: 2, exposure: 0.5, ..Sensor::CLEAN };
        let view = render(&scene, &camera, &sensor, &mut seeded(args.seed));
        files::write(path, &png(&view.rgb).map_err(|error| failed(&error))?)?;
    }
    output.plants(&Document { plants: vec![report], ..Document::default() })?;
    Ok(Exit::Done)
}
