use std::path::PathBuf;

use demeter_recon::model::Habit;

use crate::commands::import::bases;
use crate::error::{CommandError, Exit};
use crate::files;

/// Arguments of `demeter species import`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A species' folder of the release, with 2d_leaf_pca.pth, 3d_leaf_pca.pth and 3d_stem_pca.pth.
    #[arg(long)]
    release: PathBuf,
    /// The new species' name.
    #[arg(long, default_value = "soybean-release")]
    name: String,
    /// Where the file goes: .safetensors.
    #[arg(short, long)]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> Result<Exit, CommandError> {
    // The release has no ranges; its one species is soybean.
    let ranges = files::species("soybean")?.ranges;
    let species = bases(&args.release)?
        .species(&args.name, Habit::Compound, ranges)
        .map_err(|error| CommandError::failed("release", &error))?;
    files::write_species(&args.output, &species)?;
    Ok(Exit::Done)
}
