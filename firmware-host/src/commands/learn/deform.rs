//! `demeter learn deform`: joint-angle bases and articulation priors from clouds (paper 3.2).

use demeter_recon::learn::{Components, LearnError, Reach, Taught, reach, rich};

use super::clouds::Source;
use crate::error::{CommandError, Exit};
use crate::output::Output;

/// Arguments of `demeter learn deform`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    source: Source,
    /// Components of blades' bends.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u8).range(1..=40))]
    components: u8,
    /// Components of stems' bends.
    #[arg(long, default_value_t = 14, value_parser = clap::value_parser!(u8).range(1..=20))]
    stem_components: u8,
    /// Also print how near bases of fewer components come to organs of clouds that are left out (some minutes).
    #[arg(long)]
    curve: bool,
}

/// Numbers of components of the curve; the last is what is asked for.
const CURVE: [usize; 7] = [2, 4, 6, 10, 14, 18, 24];

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let failed = |error: LearnError| CommandError::failed("learn", &error);
    let source = &args.source;
    let from = source.from()?;
    let first = source.class(&rich(&from, &[]).map_err(failed)?, "shape and raw angles")?;
    // The disentangling's second round: shape and angles anew, within what the first round says of angles.
    let second = source.class(&rich(&from, &first.lessons).map_err(failed)?, "within what was learned")?;
    let components = Components { leaf: args.components.into(), stem: args.stem_components.into() };
    let taught = Taught::new(&second.lessons, &from, components).map_err(failed)?;
    let provenance = format!("{}; bends of {} by demeter learn deform", from.provenance, source.learned_from(&second));
    let species = taught.species(&from, provenance).map_err(|error| CommandError::failed("species", &error))?;
    let curve = if args.curve { reach(&second.lessons, &from, &CURVE).map_err(failed)? } else { Vec::new() };
    source.write(&species, &second, &curve, &lines(&curve), output)
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
