//! `demeter models`: the networks of this box, ours and other people's (docs/models.md).

use std::path::PathBuf;

use clap::Subcommand;
use demeter_models::{ModelError, find_manifest, find_manifests};

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod bench;
mod install;
mod list;
mod probe;
mod verify;

/// Arguments of `demeter models`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The models that are installed.
    List,
    /// Take in an ONNX file: find its layout, try it, copy it beside a manifest.
    Install(install::Args),
    /// Check that files are those of their manifests and that each model runs.
    Verify(verify::Args),
    /// Time each model.
    Bench(bench::Args),
}

/// Does what was asked for.
///
/// # Errors
/// [`CommandError`] naming the model or the file.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    match &args.what {
        What::List => list::run(output),
        What::Install(args) => install::run(args, output),
        What::Verify(args) => verify::run(args, output),
        What::Bench(args) => bench::run(args, output),
    }
}

/// The manifests of the models named, of all when none is.
fn manifests(names: &[String]) -> Result<Vec<PathBuf>, CommandError> {
    if names.is_empty() {
        return Ok(find_manifests());
    }
    names.iter().map(|name| find_manifest(name).map_err(|error| failed(&error))).collect()
}

fn failed(error: &ModelError) -> CommandError {
    CommandError::failed("model", error)
}
