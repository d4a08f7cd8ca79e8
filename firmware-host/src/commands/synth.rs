//! `demeter synth`: the synthetic world in files.

use clap::Subcommand;

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod images;

/// Arguments of `demeter synth`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Random pictures with their truth, to train networks on.
    Images(images::Args),
}

/// Makes what was asked for.
///
/// # Errors
/// [`CommandError`] when the world refuses the plan or a file cannot be written.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    match &args.what {
        What::Images(args) => images::run(args, output),
    }
}

fn species(name: &str) -> Result<demeter_recon::model::Species, CommandError> {
    let known = demeter_recon::species::NAMES.join(", ");
    demeter_recon::species::shipped(name)
        .ok_or_else(|| CommandError::usage("species", format!("no species `{name}`")).with(known, name))?
        .map_err(|error| CommandError::failed("species", &error))
}
