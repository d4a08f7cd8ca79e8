//! `demeter learn shape`: leaf shapes from masks (paper supp. "Shape").

use std::path::PathBuf;

use clap::ValueEnum;
use demeter_recon::learn::shape::{
    FEW_SCANS, FlatLeaf, GridKind, UNSEEN, broadened, equally_wide, learn, left_out, mean, widthless,
};
use demeter_recon::learn::{Ends, PcaError, rejections};
use demeter_recon::model::{Habit, Species};

use super::contours::{Rejected, Told, curve};
use super::masks::{Scans, scans};
use crate::error::{CommandError, Exit, chain};
use crate::files;
use crate::output::Output;

/// Arguments of `demeter learn shape`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Masks of flat leaves (white on black, or the opaque part of a picture): files, or folders of .png and .jpg.
    #[arg(required = true)]
    masks: Vec<PathBuf>,
    /// The species that all but the leaf shape is taken from: a name, or a file.
    #[arg(long)]
    from: String,
    /// Name of the species that comes out; that of --from by default.
    #[arg(long)]
    name: Option<String>,
    /// The species whose shape components help out where there are fewer than 30 scans; --from by default.
    #[arg(long)]
    related: Option<String>,
    /// Where in the pictures the base is.
    #[arg(long, value_enum, default_value_t = Base::Auto)]
    base: Base,
    /// How outlines become grids; auto takes oval where 19 of 20 leaves are.
    #[arg(long, value_enum, default_value_t = Grid::Auto)]
    grid: Grid,
    /// Components.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..=40))]
    components: u8,
    /// Parts that the scans are divided into; each is foretold from the others.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u8).range(2..=200))]
    folds: u8,
    /// Where the masks come from and under which licence, for the species' provenance.
    #[arg(long)]
    credit: Option<String>,
    /// Where the species that was learned goes (.safetensors).
    #[arg(short, long)]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Base {
    Auto,
    Top,
    Bottom,
    Left,
    Right,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Grid {
    Auto,
    Oval,
    Harmonic,
}

impl From<Base> for Ends {
    fn from(base: Base) -> Self {
        match base {
            Base::Auto => Self::Auto,
            Base::Top => Self::Top,
            Base::Bottom => Self::Bottom,
            Base::Left => Self::Left,
            Base::Right => Self::Right,
        }
    }
}

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let from = files::species(&args.from)?;
    let failed = |error: PcaError| CommandError::failed("learn", &error);
    let is_grass = from.habit == Habit::Grass;
    let relative = files::species(args.related.as_deref().unwrap_or(&args.from))?;
    let scans = scans(&args.masks, args.base.into())?;
    let (kind, kept, poor, rejected) = divided(&scans, args.grid);
    if kept.is_empty() {
        let reasons: Vec<String> = rejected.iter().map(|r| format!("{}: {}", r.file, r.reason)).collect();
        let message = format!("expected at least one scan to learn from, found none; {}", reasons.join("; "));
        return Err(CommandError { exit: Exit::Failed, kind: "learn", message, expected: None, found: None });
    }
    let all: Vec<FlatLeaf> = kept.iter().chain(&poor).cloned().collect();
    let [kept, all] = [kept, all].map(|leaves| if is_grass { equally_wide(&leaves) } else { leaves });
    let related = broadened(&relative.leaf.shape, &mean(&kept), UNSEEN).map_err(failed)?;
    let related = if is_grass { widthless(&related).map_err(failed)? } else { related };

    let components = usize::from(args.components);
    let shape = learn(&kept.iter().collect::<Vec<_>>(), &related, components).map_err(failed)?;
    let errors = |leaves: &[FlatLeaf]| match leaves.len() {
        0 | 1 => Ok(Vec::new()),
        _ => left_out(leaves, &related, components, args.folds.into()),
    };
    let curve = curve(&shape.explained, &errors(&kept).map_err(failed)?, &errors(&all).map_err(failed)?);

    let provenance = provenance(args, &scans, &from, &relative.name, kept.len());
    let mut species = from;
    species.leaf.shape = shape.basis;
    species.provenance = provenance;
    if let Some(name) = &args.name {
        species.name.clone_from(name);
    }
    let species = species.sealed().map_err(|error| CommandError::failed("species", &error))?;
    files::write_species(&args.output, &species)?;
    let told = Told {
        species: species.name.clone(),
        hash: species.hash().to_owned(),
        output: args.output.clone(),
        grid: kind,
        scans: scans.traced.len() + scans.refused.len(),
        kept: kept.len(),
        rejected,
        curve,
    };
    if output.json {
        output.json(&told)?
    } else {
        output.text(&told.table())?
    }
    Ok(Exit::Done)
}

/// The kind of grid, the leaves that pass the rule and those that do not though they have a grid, and the reason for
/// every scan that is left out.
fn divided(scans: &Scans, grid: Grid) -> (GridKind, Vec<FlatLeaf>, Vec<FlatLeaf>, Vec<Rejected>) {
    let rejections = rejections(&scans.traced);
    let passed = scans.traced.iter().zip(&rejections).filter(|(_, rejection)| rejection.is_none());
    let kind = match grid {
        Grid::Auto => GridKind::of(&passed.map(|(traced, _)| &traced.outline).collect::<Vec<_>>()),
        Grid::Oval => GridKind::Oval,
        Grid::Harmonic => GridKind::Harmonic,
    };
    let (mut kept, mut poor) = (Vec::new(), Vec::new());
    let mut rejected = scans.refused.clone();
    for ((traced, rejection), file) in scans.traced.iter().zip(rejections).zip(&scans.names) {
        let leaf = FlatLeaf::new(&traced.outline, kind);
        let reason = match (&rejection, &leaf) {
            (Some(rejection), _) => Some(rejection.to_string()),
            (None, Err(error)) => Some(chain(error)),
            (None, Ok(_)) => None,
        };
        if let Ok(leaf) = leaf {
            if reason.is_none() { &mut kept } else { &mut poor }.push(leaf);
        }
        rejected.extend(reason.map(|reason| Rejected { file: file.clone(), reason }));
    }
    (kind, kept, poor, rejected)
}

/// Where the shape comes from, then where the rest does.
fn provenance(args: &Args, scans: &Scans, from: &Species, relative: &str, kept: usize) -> String {
    let helped = if kept < FEW_SCANS {
        format!(", beside the components of {relative} and smooth changes")
    } else {
        String::new()
    };
    format!(
        "leaf shape of {kept} of {} scans ({}; BLAKE3 {}){helped} by demeter learn shape --base {} --grid {} \
         --components {}; the rest from {} [{}]",
        scans.traced.len() + scans.refused.len(),
        args.credit.as_deref().unwrap_or("no credit given"),
        scans.hash,
        word(args.base),
        word(args.grid),
        args.components,
        from.name,
        from.provenance
    )
}

/// A choice as it is written on the command line.
fn word(choice: impl ValueEnum) -> String {
    choice.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}
