//! `demeter edit`: a plant changed.

use std::path::PathBuf;

use demeter_recon::edit::{EditError, Move, Selection, bend, between, cut, graft};
use demeter_recon::model::{Plant, PlantError, Species, forward};
use demeter_recon::record::SpeciesRef;
use glam::DVec3;

use super::target::Target;
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::report::Document;
use crate::studio;

/// Arguments of `demeter edit`. Edits are made in the order of these options; all organs' numbers are those of IN.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant: a record.
    plant: PathBuf,
    /// Species file of the record, where it is not one of those that ship.
    #[arg(long)]
    species: Option<String>,
    /// Go towards this plant of the same topology and species.
    #[arg(long, requires = "t")]
    towards: Option<PathBuf>,
    /// How far: 0 stays, 1 arrives.
    #[arg(long, requires = "towards")]
    t: Option<f64>,
    /// Move a parameter: ORGANS:WHAT=NUMBER, or += -= *=. ORGANS: all, stems, leaves or a number. WHAT: beta.N,
    /// gamma.N (from 0, in standard deviations), scale, d, radius, width. Such as leaves:gamma.0+=0.5. Repeatable.
    #[arg(long = "move", value_name = "MOVE")]
    moves: Vec<Move>,
    /// Bend stems so many times as much: ORGANS=FACTOR, such as stems=0 (straight), 3=1.5. Repeatable.
    #[arg(long, value_name = "BEND", value_parser = bending)]
    bend: Vec<(Selection, f64)>,
    /// Copy an organ with all that hangs on it: FROM:ONTO:D, such as 4:0:0.6. Copies come last. Repeatable.
    #[arg(long, value_name = "GRAFT", value_parser = grafting)]
    graft: Vec<(usize, usize, f64)>,
    /// Cut an organ off with all that hangs on it. Repeatable.
    #[arg(long, value_name = "ORGAN")]
    cut: Vec<usize>,
    #[command(flatten)]
    target: Target,
    /// Also write a picture of the plant before (left) and after: .png.
    #[arg(long)]
    picture: Option<PathBuf>,
}

/// Picture of two plants, pixels.
const PICTURE: [u32; 2] = [1280, 720];
/// Gap between them, shares of the wider one's width.
const GAP: f64 = 0.3;

/// Edits the plant and writes what was asked for.
///
/// # Errors
/// [`CommandError`] naming the file, or `edit` naming the organ and why it cannot be so.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let refused = |error: EditError| CommandError::failed("edit", &error);
    let bytes = files::read(&args.plant)?;
    let (record, species) = files::record(&args.plant, &bytes, args.species.as_deref())?;
    let mut plant = record.plant.clone();
    if let (Some(path), Some(t)) = (&args.towards, args.t) {
        let (other, others) = files::record(path, &files::read(path)?, args.species.as_deref())?;
        if others != species {
            let (expected, found) = (SpeciesRef::of(&species), SpeciesRef::of(&others));
            let message = format!("{}: expected a plant of {expected}, found one of {found}", path.display());
            return Err(CommandError::usage("species", message).with(expected, found));
        }
        plant = between(&plant, &other.plant, t).map_err(refused)?;
    }
    for step in &args.moves {
        plant = step.apply(&plant, &species).map_err(refused)?;
    }
    for (of, factor) in &args.bend {
        plant = bend(&plant, &species, *of, *factor).map_err(refused)?;
    }
    for (from, onto, d) in &args.graft {
        plant = graft(&plant, *from, *onto, *d).map_err(refused)?;
    }
    plant = cut(&plant, &args.cut).map_err(refused)?;
    let (plant, report) = args.target.keep(&plant, &species, record.scale_source)?;
    if let Some(path) = &args.picture {
        let pair = beside(record.plant, plant, &species).map_err(|error| CommandError::failed("edit", &error))?;
        let pair = pair.into_iter().map(|plant| (&species, plant)).collect();
        files::write(path, &studio::picture(pair, PICTURE, 1)?)?;
    }
    output.plants(&Document { plants: vec![report], ..Document::default() })?;
    Ok(Exit::Done)
}

/// Both plants on the ground, the second to the right of the first.
fn beside(mut first: Plant, mut second: Plant, species: &Species) -> Result<[Plant; 2], PlantError> {
    let mut reach = [(0.0, 0.0); 2];
    for (plant, reach) in [&mut first, &mut second].into_iter().zip(&mut reach) {
        plant.world_from_plant.translation = DVec3::ZERO;
        let posed = forward(plant, species)?;
        let x = || posed.control.iter().flatten().map(|p| p.x);
        *reach = (x().fold(f64::MAX, f64::min), x().fold(f64::MIN, f64::max));
    }
    let [a, b] = reach;
    let gap = (a.1 - a.0).max(b.1 - b.0) * GAP;
    second.world_from_plant.translation.x = a.1 - b.0 + gap;
    Ok([first, second])
}

fn bending(text: &str) -> Result<(Selection, f64), String> {
    let parts = text.split_once('=').and_then(|(of, factor)| Some((of.parse().ok()?, factor.parse().ok()?)));
    parts.ok_or_else(|| "expected ORGANS=FACTOR, such as stems=0.5".into())
}

fn grafting(text: &str) -> Result<(usize, usize, f64), String> {
    let mut parts = text.splitn(3, ':');
    let parsed = (|| {
        let (from, onto, d) = (parts.next()?, parts.next()?, parts.next()?);
        Some((from.parse().ok()?, onto.parse().ok()?, d.parse().ok()?))
    })();
    parsed.ok_or_else(|| "expected FROM:ONTO:D, such as 4:0:0.6".into())
}
