//! `demeter learn`: a species from scans, step by step. Each step takes a species and writes one that knows more.

use clap::Subcommand;

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod adapt;
mod clouds;
mod contours;
mod deform;
mod masks;
mod shape;

/// Arguments of `demeter learn`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Flat leaf shapes, from masks of scans.
    Shape(shape::Args),
    /// How blades and stems bend and how organs hang, from clouds of plants or of single leaves.
    Deform(deform::Args),
    /// A related species' shape, bends and priors, refined on a handful of plants or leaves.
    Adapt(adapt::Args),
}

/// Learns what was asked for.
///
/// # Errors
/// [`CommandError`] when nothing can be learned or a file cannot be read or written.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    match &args.what {
        What::Shape(args) => shape::run(args, output),
        What::Deform(args) => deform::run(args, output),
        What::Adapt(args) => adapt::run(args, output),
    }
}
