//! `demeter learn adapt`: a related species refined on a handful of organs (paper supp. "Sensitivity to dataset size").

use std::path::PathBuf;

use demeter_recon::learn::{LearnError, adapted, rich_in_shape};
use serde_json::json;

use super::clouds::{lessons, table};
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;

/// Arguments of `demeter learn adapt`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Clouds as for `demeter learn deform`.
    #[arg(required = true)]
    clouds: Vec<PathBuf>,
    /// The related species: a name, or a file.
    #[arg(long)]
    from: String,
    /// Name of the species that comes out.
    #[arg(long)]
    name: String,
    /// Where it goes (.safetensors).
    #[arg(short, long)]
    output: PathBuf,
    /// Where the clouds come from and under which licence, for the species' provenance.
    #[arg(long)]
    credit: Option<String>,
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let failed = |error: LearnError| CommandError::failed("learn", &error);
    let from = files::species(&args.from)?;
    let rich = rich_in_shape(&from).map_err(failed)?;
    let (lessons, told) = lessons(&args.clouds, &rich, "shape and raw angles")?;
    let taught = adapted(&lessons, &from).map_err(failed)?;
    let blades: usize = lessons.iter().map(|l| l.leaves.len()).sum();
    let provenance = format!(
        "{} [{}]; adapted on {blades} blades of {} clouds ({}) by demeter learn adapt",
        from.name,
        from.provenance,
        args.clouds.len(),
        args.credit.as_deref().unwrap_or("no credit given")
    );
    let mut species = taught.species(&from, provenance).map_err(|error| CommandError::failed("species", &error))?;
    species.name.clone_from(&args.name);
    let bytes = species.to_bytes().map_err(|error| CommandError::failed("species", &error))?;
    files::write(&args.output, &bytes)?;
    if output.json {
        output.json(&json!({ "species": args.name, "output": args.output, "blades": blades, "clouds": told }))?;
    } else {
        output.text(&format!("{}{blades} blades -> {}\n", table(&told), args.output.display()))?;
    }
    Ok(if lessons.iter().any(|l| l.leaves.is_empty()) { Exit::Partial } else { Exit::Done })
}
