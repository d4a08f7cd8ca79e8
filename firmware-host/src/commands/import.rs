//! `demeter import`: a plant of the authors' release becomes a record.

use std::path::{Path, PathBuf};

use demeter_recon::import::release::{Bases, FILES, PLANT_FILES, RawPlant, ReleaseError, ReleasePlant};
use demeter_recon::model::{PosedPlant, forward};
use demeter_recon::organs::ScaleSource;
use glam::DVec3;

use super::target::Target;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::report::Document;

/// Arguments of `demeter import`. The release's licence is academic and non-commercial: so is what comes of it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant's folder, with graph.pkl and info/.
    plant: PathBuf,
    /// The release's folder of bases; the one around the plant's unless given.
    #[arg(long)]
    release: Option<PathBuf>,
    /// Species to hold the plant in: best one from `demeter species import`.
    #[arg(long)]
    species: String,
    #[command(flatten)]
    target: Target,
}

/// Reads the plant, projects it on the species and writes the record; a warning says how far that moved its points.
///
/// # Errors
/// [`CommandError`] naming the file and what is wrong with it.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let failed = |error: &dyn std::error::Error| CommandError::failed("release", error);
    let species = files::species(&args.species)?;
    let around = args.plant.join("..");
    let bases = bases(args.release.as_ref().unwrap_or(&around))?;
    let plant = release_plant(&args.plant)?;
    let raw = RawPlant::of(&plant, &bases);
    let (projected, mut report) = args.target.keep(&raw.project(&species), &species, ScaleSource::Input)?;
    let before = raw.pose().map_err(|error| failed(&error))?;
    let after = forward(&projected, &species).map_err(|error| failed(&error))?;
    report.warnings.push(format!(
        "control points moved by {:.2} % of the plant's diagonal on average, for its angles do not all lie in the species' basis",
        100.0 * moved(&before, &after)
    ));
    if !plant.left_out.is_empty() {
        report.warnings.push(format!("nodes of other classes than leaf and stem were left out: {:?}", plant.left_out));
    }
    output.plants(&Document { plants: vec![report], ..Document::default() })?;
    Ok(Exit::Done)
}

/// Mean distance of control points in diagonals of the first plant's.
fn moved(before: &PosedPlant, after: &PosedPlant) -> f64 {
    let points = || before.control.iter().flatten();
    let (low, high) = points().fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
    let sum: f64 = points().zip(after.control.iter().flatten()).map(|(a, b)| a.distance(*b)).sum();
    sum / points().count() as f64 / low.distance(high)
}

/// The bases in a folder of the release.
///
/// # Errors
/// [`CommandError`] naming the file.
pub(super) fn bases(folder: &Path) -> Result<Bases, CommandError> {
    read(folder, FILES, Bases::read)
}

/// The plant in a folder of the release.
///
/// # Errors
/// [`CommandError`] naming the file.
pub(super) fn release_plant(folder: &Path) -> Result<ReleasePlant, CommandError> {
    read(folder, PLANT_FILES, ReleasePlant::read)
}

fn read<T>(folder: &Path, names: [&str; 3], of: fn([&[u8]; 3]) -> Result<T, ReleaseError>) -> Result<T, CommandError> {
    let [a, b, c] = names.map(|name| files::read(&folder.join(name)));
    of([&a?, &b?, &c?]).map_err(|error| CommandError::failed("release", &error).of(folder))
}
