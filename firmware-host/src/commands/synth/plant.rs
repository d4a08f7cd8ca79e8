use std::path::PathBuf;

use demeter_recon::organs::ScaleSource;
use demeter_recon::record::encode_exact;
use demeter_recon::world::{grow, seeded};

use super::unit_interval;
use crate::describe::report;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::report::Document;
use crate::studio;

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
    let mut report = report(&plant, &species, record.len(), ScaleSource::Input, &[])?;
    report.record = Some(args.output.display().to_string());
    if let Some(path) = &args.picture {
        files::write(path, &studio::picture(vec![(&species, plant)], [PICTURE_SIDE; 2], args.seed)?)?;
    }
    output.plants(&Document { plants: vec![report], ..Document::default() })?;
    Ok(Exit::Done)
}
