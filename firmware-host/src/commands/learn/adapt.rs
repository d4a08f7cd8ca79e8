//! `demeter learn adapt`: a related species refined on a handful of organs (paper supp. "Sensitivity to dataset size").

use std::path::PathBuf;

use demeter_recon::learn::{Lesson, adapted, rich_in_shape};
use demeter_recon::model::Species;
use serde::Serialize;

use super::clouds::{Source, plant_errors};
use crate::error::{CommandError, Exit};
use crate::output::Output;

/// Arguments of `demeter learn adapt`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: Source,
    /// Name of the species that comes out.
    #[arg(long)]
    name: String,
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
    let source = &args.source;
    let from = source.from()?;
    let rich = rich_in_shape(&from).map_err(|error| CommandError::failed("learn", &error))?;
    let class = source.class(&rich, "shape and raw angles")?;
    let learned_from = source.learned_from(&class);
    let provenance = format!("{} [{}]; adapted on {learned_from} by demeter learn adapt", from.name, from.provenance);
    let mut species = learned(&class.lessons, &from, provenance)?;
    species.name.clone_from(&args.name);
    let species = species.sealed().map_err(|error| CommandError::failed("species", &error))?;
    let curve = curve(&args.held_out, &class.lessons, &from)?;
    source.write(&species, &class, &curve, &lines(&curve), output)
}

fn learned(lessons: &[Lesson], from: &Species, provenance: String) -> Result<Species, CommandError> {
    let taught = adapted(lessons, from).map_err(|error| CommandError::failed("learn", &error))?;
    taught.species(from, provenance).map_err(|error| CommandError::failed("species", &error))
}

/// Errors of the species learned from the first 0, 1, 2, .. clouds on the blades of held-out plants.
fn curve(held_out: &[PathBuf], lessons: &[Lesson], from: &Species) -> Result<Vec<At>, CommandError> {
    if held_out.is_empty() {
        return Ok(Vec::new());
    }
    let judge = |clouds: usize| {
        let species = match clouds {
            0 => from.clone(),
            _ => learned(&lessons[..clouds], from, String::new())?,
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
