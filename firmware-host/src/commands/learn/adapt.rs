//! `demeter learn adapt`: a related species refined on a handful of organs (paper supp. "Sensitivity to dataset size").

use std::path::PathBuf;

use demeter_recon::learn::{LearnError, Lesson, adapted, rich_in_shape};
use demeter_recon::model::Species;
use serde::Serialize;
use serde_json::json;

use super::clouds::{lessons, plant_errors, table};
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
    /// Plants to judge by: also print the error of their blades against the number of clouds learned from.
    #[arg(long, num_args = 1..)]
    held_out: Vec<PathBuf>,
}

/// The error of one number of clouds learned from.
#[derive(Debug, Serialize)]
struct At {
    clouds: usize,
    blades: usize,
    /// Median over the blades of held-out plants: Chamfer distance by the diagonal of the blade's points.
    median: f64,
    /// The same, nine tenths of the blades are below.
    ninth_decile: f64,
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
    let curve = curve(&args.held_out, &lessons, &from)?;
    if output.json {
        output.json(&json!({
            "species": args.name, "output": args.output, "blades": blades, "clouds": told, "curve": curve,
        }))?;
    } else {
        output.text(&format!("{}{}{blades} blades -> {}\n", table(&told), lines(&curve), args.output.display()))?;
    }
    Ok(if lessons.iter().any(|l| l.leaves.is_empty()) { Exit::Partial } else { Exit::Done })
}

/// Errors of the species learned from the first 0, 1, 2, .. clouds on the blades of held-out plants.
fn curve(held_out: &[PathBuf], lessons: &[Lesson], from: &Species) -> Result<Vec<At>, CommandError> {
    if held_out.is_empty() {
        return Ok(Vec::new());
    }
    let judge = |clouds: usize| {
        let failed = |error: LearnError| CommandError::failed("learn", &error);
        let species = match clouds {
            0 => from.clone(),
            _ => adapted(&lessons[..clouds], from)
                .map_err(failed)?
                .species(from, String::new())
                .map_err(|error| CommandError::failed("species", &error))?,
        };
        let mut errors = Vec::new();
        for path in held_out {
            errors.extend(plant_errors(path, &species)?);
        }
        errors.sort_by(f64::total_cmp);
        let at = |share: f64| errors.get((errors.len() as f64 * share) as usize).copied().unwrap_or(f64::NAN);
        Ok(At { clouds, blades: errors.len(), median: at(0.5), ninth_decile: at(0.9) })
    };
    (0..=lessons.len()).map(judge).collect()
}

fn lines(curve: &[At]) -> String {
    if curve.is_empty() {
        return String::new();
    }
    let mut text = "clouds  blades held out  median CD / diagonal  ninth decile\n".to_owned();
    for at in curve {
        text += &format!("{:>6}  {:>15}  {:>20.4}  {:>12.4}\n", at.clouds, at.blades, at.median, at.ninth_decile);
    }
    text
}
