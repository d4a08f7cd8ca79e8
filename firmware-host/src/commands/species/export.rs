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
    files::write_species(&args.output, &files::species(&args.name)?)?;
    Ok(Exit::Done)
}
