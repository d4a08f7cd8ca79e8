//! `demeter eval`: the tables of spec/reconstruction.md, one file each, on data beside the checkout or at a given
//! path. docs/evaluation.md is made of them by `make evaluation`.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::{CommandError, Exit};
use crate::output::Output;

mod baselines;
mod clouds;
mod depth;
mod fit;
mod green;
mod leaf;
mod photo;
mod picture;
mod release;
mod segment;
mod table;
mod topology;
mod traits;
mod truth;

/// Arguments of `demeter eval`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    table: Which,
}

#[derive(Debug, Subcommand)]
enum Which {
    /// Depth, camera and organs from single pictures.
    Depth(depth::Args),
    /// Chamfer distance and bytes of whole plants, with labels and without, beside baselines.
    Fit(fit::Args),
    /// Chamfer distance and time of single blades, beside loose surfaces.
    Leaf(leaf::Args),
    /// Plants of one photo: counts, outlines, lengths, other views, rows.
    Photo(photo::Args),
    /// Clouds divided into organs without their labels: instances, classes, blades, stems.
    Segment(segment::Args),
    /// Share of organs with the right parent.
    Topology(topology::Args),
    /// Traits of the decoded record against a generator's truth.
    Traits(traits::Args),
}

/// Makes the table asked for and prints it.
///
/// # Errors
/// [`CommandError`] when the data are missing or cannot be read.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let table = match &args.table {
        Which::Depth(args) => depth::table(args)?,
        Which::Fit(args) => fit::table(args)?,
        Which::Leaf(args) => leaf::table(args)?,
        Which::Photo(args) => photo::table(args)?,
        Which::Segment(args) => segment::table(args)?,
        Which::Topology(args) => topology::table(args)?,
        Which::Traits(args) => traits::table(args)?,
    };
    if output.json {
        output.json(&table)?;
    } else {
        output.text(&table.markdown())?;
    }
    Ok(Exit::Done)
}

/// Where the data stand beside a development checkout.
const SHARED: &str = "../shared/data";

/// A folder of data: the given one, else `name` of the shared data.
///
/// # Errors
/// [`CommandError`] `data` naming the folder and the option when it is not there.
fn folder(given: Option<&PathBuf>, name: &str, option: &'static str) -> Result<PathBuf, CommandError> {
    let path = given.cloned().unwrap_or_else(|| Path::new(SHARED).join(name));
    if path.is_dir() {
        return Ok(path);
    }
    let message =
        format!("{}: expected a folder; run from a checkout beside ../shared or give {option}", path.display());
    Err(CommandError::usage("data", message).with(format!("a folder, {option}"), "none"))
}

/// Files of a folder and its subfolders that end in `.extension`, sorted.
///
/// # Errors
/// [`CommandError`] `file` when a folder cannot be read, `data` when there are none.
fn files_of(folder: &Path, extension: &str) -> Result<Vec<PathBuf>, CommandError> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let failed = |error: std::io::Error| crate::files::file_error(&folder, &error);
        for entry in std::fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            if entry.file_type().map_err(failed)?.is_dir() {
                folders.push(entry.path());
            } else if entry.path().extension().is_some_and(|e| e == extension) {
                found.push(entry.path());
            }
        }
    }
    found.sort();
    if found.is_empty() {
        let message = format!("{}: expected files .{extension}, found none", folder.display());
        return Err(CommandError::usage("data", message).with(format!("files .{extension}"), "none"));
    }
    Ok(found)
}

/// A bar on standard error; indicatif hides it when that is no terminal.
fn progress(steps: usize) -> ProgressBar {
    let bar = ProgressBar::new(steps as u64);
    // The template is ours and sound; without it the bar is merely plainer.
    if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} {eta}  {msg}") {
        bar.set_style(style);
    }
    bar
}
