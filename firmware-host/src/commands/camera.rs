//! `demeter camera`: the cameras of this box.

use clap::Subcommand;

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod calibrate;
mod list;
mod pick;
mod preview;
mod record;

/// Arguments of `demeter camera`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The calibration of a camera out of pictures of a checkerboard.
    Calibrate(calibrate::Args),
    /// The cameras that are plugged in, where, and what they offer.
    List,
    /// One picture of a camera, to see where it looks.
    Preview(preview::Args),
    /// Record the cameras into a session's folder.
    Record(record::Args),
}

/// Does what was asked for.
///
/// # Errors
/// [`CommandError`] naming the camera or the file.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    match &args.what {
        What::Calibrate(args) => calibrate::run(args, output),
        What::List => list::run(output),
        What::Preview(args) => preview::run(args, output),
        What::Record(args) => record::run(args, output),
    }
}
