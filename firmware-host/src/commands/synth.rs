//! `demeter synth`: the synthetic world in files.

use std::path::Path;

use clap::Subcommand;
use demeter_recon::model::Species;

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod clouds;
mod images;
mod session;

/// Arguments of `demeter synth`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// A recorded session of a row, with its truth.
    Session(session::Args),
    /// Labelled point clouds of single plants.
    Clouds(clouds::Args),
    /// Random pictures with their truth, to train networks on.
    Images(images::Args),
}

/// Makes what was asked for.
///
/// # Errors
/// [`CommandError`] when the world refuses the plan or a file cannot be written.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    match &args.what {
        What::Session(args) => session::run(args, output),
        What::Clouds(args) => clouds::run(args, output),
        What::Images(args) => images::run(args, output),
    }
}

fn species(name: &str) -> Result<Species, CommandError> {
    let known = demeter_recon::species::NAMES.join(", ");
    demeter_recon::species::shipped(name)
        .ok_or_else(|| CommandError::usage("species", format!("no species `{name}`")).with(known, name))?
        .map_err(|error| CommandError::failed("species", &error))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    std::fs::write(path, bytes).map_err(|error| file_error(path, &error))
}

fn file_error(path: &Path, error: &std::io::Error) -> CommandError {
    CommandError::failed("file", &std::io::Error::new(error.kind(), format!("{}: {error}", path.display())))
}

fn unit_interval(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("expected a number from 0 to 1".into()),
    }
}
