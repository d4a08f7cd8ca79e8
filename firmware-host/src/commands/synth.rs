//! `demeter synth`: the synthetic world in files.

use clap::Subcommand;

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod assets;
mod clouds;
mod images;
mod plant;
mod session;

/// Arguments of `demeter synth`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// One plant: its exact record, mesh and picture.
    Plant(plant::Args),
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
        What::Plant(args) => plant::run(args, output),
        What::Session(args) => session::run(args, output),
        What::Clouds(args) => clouds::run(args, output),
        What::Images(args) => images::run(args, output),
    }
}

fn unit_interval(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("expected a number from 0 to 1".into()),
    }
}
