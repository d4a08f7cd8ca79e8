//! `demeter fit`: a point cloud becomes a plant.

use std::path::PathBuf;
use std::time::Instant;

use clap::ValueEnum;
use demeter_recon::cloud::{PointCloud, PointOrgan};
use demeter_recon::export::cloud_to_ply;
use demeter_recon::model::OrganKind;
use demeter_recon::organs::{OrganTree, ScaleSource};
use demeter_recon::segment::{Labels, Up};
use demeter_recon::{fit, tree};
use glam::DVec3;

use super::target::Target;
use crate::describe::describe;
use crate::divider::{Divided, Divider, OrganSource};
use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::report::Document;

/// Arguments of `demeter fit`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The cloud: PLY, ascii or binary.
    cloud: PathBuf,
    /// Species to fit.
    #[arg(long)]
    species: String,
    /// Where organs come from. auto: the cloud's properties `organ` and `kind` (0 main stem, 1 stem or petiole, 2
    /// leaf; negative organs are left out), as --points writes them; else its `label` (0 all stems, 1.. one a leaf),
    /// else what --organs says. label: its `label`, which it must have. none: what --organs says.
    #[arg(long, value_enum, default_value_t)]
    labels: LabelSource,
    /// What finds organs without labels. Where the network does not open, geometry stands in and a warning says so.
    #[arg(long, value_enum, default_value_t)]
    organs: OrganSource,
    /// Unit of the cloud's coordinates.
    #[arg(long, value_enum, default_value_t)]
    unit: Unit,
    /// The cloud's vertical axis.
    #[arg(long, value_enum, default_value_t)]
    up: Axis,
    #[command(flatten)]
    target: Target,
    /// Also write the input points, in order, with `organ` and `kind`; `fit` takes the file as organs already apart.
    #[arg(long)]
    points: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum LabelSource {
    #[default]
    Auto,
    Label,
    None,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Unit {
    #[default]
    M,
    Cm,
    Mm,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Axis {
    X,
    Y,
    #[default]
    Z,
    Auto,
}

/// Fits the cloud and writes what was asked for.
///
/// # Errors
/// [`CommandError`] naming the file, option or reason.
pub fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let started = Instant::now();
    let species = files::species(&args.species)?;
    let mut cloud = PointCloud::from_ply(&files::read(&args.cloud)?).map_err(|error| args.refused("ply", &error))?;
    let metres = match args.unit {
        Unit::M => 1.0,
        Unit::Cm => 1e-2,
        Unit::Mm => 1e-3,
    };
    cloud.points.iter_mut().for_each(|p| *p *= metres);
    let up = match args.up {
        Axis::X => Up::Axis(DVec3::X),
        Axis::Y => Up::Axis(DVec3::Y),
        Axis::Z => Up::Axis(DVec3::Z),
        Axis::Auto => Up::Auto,
    };
    let labels = match args.labels {
        LabelSource::Auto => Labels::Auto,
        LabelSource::Label => Labels::Own,
        LabelSource::None => Labels::None,
    };
    let Divided { segmented, network, degraded } = Divider::new(args.organs)
        .divide(&cloud, &species, labels, up)
        .map_err(|error| args.refused("segmentation", &error))?;
    if let Some(name) = network {
        tracing::info!("organs were found by {name}");
    }
    let tree = tree::build(segmented.organs).map_err(|error| args.refused("topology", &error))?;
    let fitted = fit::plant(&tree, &species, segmented.up).map_err(|error| args.refused("fit", &error))?;
    let mut described = describe(&fitted, &species, &cloud.points, ScaleSource::Input, args.target.encoding())?;
    args.target.write(&described.record, &described.plant, &species, &mut described.report)?;
    if let Some(path) = &args.points {
        cloud.organs = Some(point_organs(cloud.points.len(), &tree, &fitted));
        files::write(path, &cloud_to_ply(&cloud))?;
    }
    described.report.ms = Some(started.elapsed().as_secs_f64() * 1e3);
    let plants = vec![described.report];
    let warnings = degraded.into_iter().collect();
    output.plants(&Document { plants, warnings, seconds: Some(started.elapsed().as_secs_f64()) })?;
    Ok(Exit::Done)
}

impl Args {
    fn refused(&self, kind: &'static str, error: &dyn std::error::Error) -> CommandError {
        CommandError::failed(kind, error).of(&self.cloud)
    }
}

/// The organ of the record that each point was given to.
fn point_organs(points: usize, tree: &OrganTree, fitted: &fit::Fitted) -> Vec<PointOrgan> {
    // Labels of fewer points than an organ needs belong to none.
    let mut organs = vec![PointOrgan { organ: -1, kind: OrganKind::Stem }; points];
    for (organ, fit) in fitted.organs.iter().enumerate() {
        let Some(source) = fit.source.map(|k| &tree.organs[k]) else { continue };
        for i in &source.source {
            organs[*i as usize] = PointOrgan { organ: organ as i32, kind: source.kind };
        }
    }
    organs
}
