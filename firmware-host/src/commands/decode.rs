//! `demeter decode`: a record becomes its plant again.

use std::path::PathBuf;

use crate::describe::report;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::report::Document;

/// Arguments of `demeter decode`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The record: compact or exact.
    record: PathBuf,
    /// The species file that the record was written with, where it is not one of those that ship.
    #[arg(long)]
    species: Option<String>,
    /// Also write the plant's surface: .ply, .obj or .glb.
    #[arg(long)]
    mesh: Option<PathBuf>,
}

/// Decodes the record and tells of its plant.
///
/// # Errors
/// [`CommandError`] naming the file and what is wrong with it.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let bytes = files::read(&args.record)?;
    let (record, species) = files::record(&args.record, &bytes, args.species.as_deref())?;
    let mut report = report(&record.plant, &species, bytes.len(), record.scale_source, &[])?;
    report.record = Some(args.record.display().to_string());
    if let Some(path) = &args.mesh {
        files::write_mesh(path, &record.plant, &species)?;
    }
    output.plants(&Document { plants: vec![report], ..Document::default() })?;
    Ok(Exit::Done)
}
