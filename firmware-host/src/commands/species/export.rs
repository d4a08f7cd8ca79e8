use std::path::PathBuf;

use crate::error::{CommandError, Exit};
use crate::files;

/// Arguments of `demeter species export`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Its name.
    name: String,
    /// Where the file goes: .safetensors.
    #[arg(short, long)]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> Result<Exit, CommandError> {
    let species = files::species(&args.name)?;
    let bytes = species.to_bytes().map_err(|error| CommandError::failed("species", &error))?;
    files::write(&args.output, &bytes)?;
    Ok(Exit::Done)
}
