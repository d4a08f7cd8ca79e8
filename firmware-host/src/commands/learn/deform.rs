//! `demeter learn deform`: joint-angle bases and articulation priors from clouds (paper 3.2).

use std::path::PathBuf;

use demeter_recon::learn::{Components, LearnError, Reach, Taught, reach, rich};
use serde_json::json;

use super::clouds::{lessons, table};
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;

/// Arguments of `demeter learn deform`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Clouds. A plant: PLY in metres, z up, with `organ` and `kind` as `demeter fit --points` writes them, or with
    /// `label`. One leaf: any other PLY, or text with x y z first, in any unit.
    #[arg(required = true)]
    clouds: Vec<PathBuf>,
    /// The species whose shapes are taken: a name, or a file.
    #[arg(long)]
    from: String,
    /// Where the species that was learned goes (.safetensors).
    #[arg(short, long)]
    output: PathBuf,
    /// Components of blades' bends.
    #[arg(long, default_value_t = 18, value_parser = clap::value_parser!(u8).range(1..=40))]
    components: u8,
    /// Components of stems' bends.
    #[arg(long, default_value_t = 14, value_parser = clap::value_parser!(u8).range(1..=20))]
    stem_components: u8,
    /// Where the clouds come from and under which licence, for the species' provenance.
    #[arg(long)]
    credit: Option<String>,
    /// Also print how near bases of fewer components come to organs of clouds that are left out (some minutes).
    #[arg(long)]
    curve: bool,
}

/// Numbers of components of the curve; the last is what is asked for.
const CURVE: [usize; 7] = [2, 4, 6, 8, 10, 14, 18];

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let failed = |error: LearnError| CommandError::failed("learn", &error);
    let from = files::species(&args.from)?;
    let (first, _) = lessons(&args.clouds, &rich(&from, &[]).map_err(failed)?, "shape and raw angles")?;
    // The disentangling's second round: shape and angles anew, within what the first round says of angles.
    let (second, told) = lessons(&args.clouds, &rich(&from, &first).map_err(failed)?, "within what was learned")?;
    let components = Components { leaf: args.components.into(), stem: args.stem_components.into() };
    let taught = Taught::new(&second, &from, components).map_err(failed)?;
    let blades: usize = second.iter().map(|l| l.leaves.len()).sum();
    let stems: usize = second.iter().map(|l| l.stems.len()).sum();
    let provenance = format!(
        "{}; bends of {blades} blades and {stems} stems of {} clouds ({}) by demeter learn deform",
        from.provenance,
        args.clouds.len(),
        args.credit.as_deref().unwrap_or("no credit given")
    );
    let species = taught.species(&from, provenance).map_err(|error| CommandError::failed("species", &error))?;
    files::write(&args.output, &species.to_bytes().map_err(|error| CommandError::failed("species", &error))?)?;
    let curve = if args.curve { reach(&second, &from, &CURVE).map_err(failed)? } else { Vec::new() };
    if output.json {
        output.json(&json!({
            "species": species.name, "output": args.output, "hash": species.hash(),
            "blades": blades, "stems": stems, "clouds": told, "curve": curve,
        }))?;
    } else {
        output.text(&format!(
            "{}{}{blades} blades, {stems} stems -> {}\n",
            table(&told),
            lines(&curve),
            args.output.display()
        ))?;
    }
    Ok(if second.iter().any(|l| l.leaves.is_empty()) { Exit::Partial } else { Exit::Done })
}

fn lines(curve: &[Reach]) -> String {
    if curve.is_empty() {
        return String::new();
    }
    let mut text = "components  left-out blades  left-out stems  (mean error, % of the organ's length)\n".to_owned();
    for at in curve {
        let stem = at.stem.map_or("-".to_owned(), |stem| format!("{:.4}", 100.0 * stem));
        text += &format!("{:>10}  {:>15.4}  {stem:>14}\n", at.components, 100.0 * at.leaf);
    }
    text
}
