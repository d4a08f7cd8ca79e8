//! `demeter species`: what the program knows of kinds of plants.

use clap::Subcommand;

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod export;
mod import;
mod list;
mod show;

/// Arguments of `demeter species`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The species that ship.
    List,
    /// All of one species: where it comes from, its components, its ranges.
    Show(show::Args),
    /// Write a species file.
    Export(export::Args),
    /// Make a species file from the bases of the authors' release (academic, non-commercial).
    Import(import::Args),
}

/// Does what was asked for.
///
/// # Errors
/// [`CommandError`] naming the species or the file.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    match &args.what {
        What::List => list::run(output),
        What::Show(args) => show::run(args, output),
        What::Export(args) => export::run(args),
        What::Import(args) => import::run(args),
    }
}
