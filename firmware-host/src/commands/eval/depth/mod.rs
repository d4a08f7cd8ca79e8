//! `demeter eval depth`: what our networks say of single pictures, beside what is known: depth and plants of fields, the
//! camera, organs.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use demeter_frame::Rgb;
use demeter_models::{DepthNetwork, Organ2d, OrganMaps, Runtime, find_manifest};
use demeter_recon::statistics::{mean, median};

use super::folder;
use super::table::{Cell, Table};
use crate::config::{ModelsConfig, OURS};
use crate::error::CommandError;
use crate::eye::EyeError;
use crate::raster::nearest;

mod camera;
mod fields;
mod relative;
mod rendered;
mod sideviews;

/// Arguments of `demeter eval depth`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Pictures of fields: a folder with image/ and depth/, files of equal names; by default the shared field-rows.
    #[arg(long)]
    fields: Option<PathBuf>,
    /// A scan with the exact camera of every picture: a folder with images/ and metadata/images/; by default the shared
    /// multiview/virtual_plant.
    #[arg(long)]
    scan: Option<PathBuf>,
    /// Plants on white, cut at the pot's rim; by default the shared maize-sideviews/CountingByRegression_CNNs.
    #[arg(long)]
    sideviews: Option<PathBuf>,
    /// Rendered pictures with their truth, of `demeter synth images`, that nothing was trained on.
    #[arg(long)]
    rendered: Vec<PathBuf>,
    /// Take every N-th picture.
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Longest side given to the network, pixels.
    #[arg(long, default_value_t = Organ2d::LONG_SIDE)]
    size: u32,
}

/// One figure over the pictures of a set.
struct Row {
    set: String,
    figure: &'static str,
    /// Of each picture.
    ours: Vec<f64>,
    /// Of each picture, what a guess that does not look at it gets.
    ramp: Vec<f64>,
    goal: Goal,
}

#[derive(Clone, Copy)]
enum Goal {
    AtMost(f64),
    AtLeast(f64),
    /// As a part of the mean of the other guess.
    OfRamp(f64),
    Nothing,
}

pub(super) fn table(args: &Args) -> Result<Table, CommandError> {
    let columns = ["set", "figure", "pictures", "mean", "median", "ramp", "goal", "share within"];
    let mut table = Table::new("depth", &columns);
    let mut network = Ours::open(args.size).map_err(CommandError::from)?;
    let mut rows = fields::judge(&mut network, &folder(args.fields.as_ref(), "field-rows", "--fields")?, args.every)?;
    let scan = folder(args.scan.as_ref(), "multiview/virtual_plant", "--scan")?;
    rows.extend(camera::judge(&mut network, &scan, args.every)?);
    let name = "maize-sideviews/CountingByRegression_CNNs";
    let sideviews = folder(args.sideviews.as_ref(), name, "--sideviews")?;
    rows.extend(sideviews::judge(&mut network, &sideviews, args.every)?);
    for folder in &args.rendered {
        rows.extend(rendered::judge(&mut network, folder, args.every)?);
    }
    table.rows = rows.iter().map(Row::cells).collect();
    table.notes.push(
        "AbsRel: mean of |found - true| / true of inverse depth, found being scaled and shifted to fit best (least squares) \
         on the same pixels, as is the ramp, linear in y; plants there are what is green"
            .into(),
    );
    table
        .notes
        .push("field of view: error as a part of the truth; tilt: angle between upward directions, degrees".into());
    Ok(table)
}

/// Our networks, as a photo is given to them.
struct Ours {
    organs: Organ2d,
    depth: DepthNetwork,
}

impl Ours {
    fn open(long_side: u32) -> Result<Self, EyeError> {
        let runtime = Runtime::load(None)?;
        let organs = Organ2d::open(&runtime, &find_manifest(OURS)?, NonZeroUsize::MIN)?.with_long_side(long_side)?;
        let depth = find_manifest(&ModelsConfig::default().depth)?;
        Ok(Self { organs, depth: DepthNetwork::open(&runtime, &depth, NonZeroUsize::MIN)? })
    }

    /// What they say of a picture, depth by the network for it.
    fn run(&mut self, picture: &Rgb) -> Result<OrganMaps, CommandError> {
        let failed = |error| CommandError::failed("model", &error);
        let mut maps = self.organs.run(picture).map_err(failed)?;
        let depth = self.depth.run(picture).map_err(failed)?.log_depth();
        maps.log_depth = nearest(&depth, maps.dist.width(), maps.dist.height());
        Ok(maps)
    }
}

impl Row {
    fn cells(&self) -> Vec<Cell> {
        let goal = match self.goal {
            Goal::AtMost(goal) | Goal::AtLeast(goal) => Some(goal),
            Goal::OfRamp(part) => mean(&self.ramp).map(|ramp| part * ramp),
            Goal::Nothing => None,
        };
        let reached = |value: f64, goal: f64| match self.goal {
            Goal::AtLeast(_) => value >= goal,
            _ => value <= goal,
        };
        let within = goal
            .filter(|_| !matches!(self.goal, Goal::OfRamp(_)))
            .and_then(|goal| mean(self.ours.iter().map(|value| f64::from(u8::from(reached(*value, goal))))));
        vec![
            Cell::Text(self.set.clone()),
            self.figure.into(),
            Cell::Count(self.ours.len()),
            Cell::figure(mean(&self.ours), 3),
            Cell::figure(median(&self.ours), 3),
            Cell::figure(mean(&self.ramp), 3),
            Cell::figure(goal, 3),
            Cell::figure(within, 2),
        ]
    }
}
