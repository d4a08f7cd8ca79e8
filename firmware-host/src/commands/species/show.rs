use std::path::PathBuf;

use demeter_frame::Pose;
use demeter_recon::model::leaf::Blade;
use demeter_recon::model::{Form, Habit, Joint, Organ, Plant, Range, Ranges, Species};
use glam::{DQuat, DVec3};
use serde::Serialize;

use crate::error::{CommandError, Exit};
use crate::files;
use crate::output::Output;
use crate::studio;

/// Arguments of `demeter species show`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A name or a species file.
    name: String,
    /// Also draw its leaf: .png. Rows from below: the mean leaf and its first shape components at -2 and +2 standard
    /// deviations, then the first ways in which it bends.
    #[arg(long)]
    picture: Option<PathBuf>,
}

/// A species in a few numbers.
#[derive(Serialize)]
pub(super) struct Summary<'a> {
    pub name: &'a str,
    pub habit: Habit,
    /// BLAKE3 of the species file: what records name.
    pub hash: &'a str,
    pub provenance: &'a str,
    /// Numbers of components.
    pub leaf_shape: usize,
    pub leaf_deform: usize,
    pub stem_deform: usize,
    /// Metres; the width is a factor.
    pub ranges: Ranges,
}

impl<'a> Summary<'a> {
    pub(super) fn of(species: &'a Species) -> Self {
        let Species { name, habit, ranges, provenance, leaf, stem, .. } = species;
        Self {
            name,
            habit: *habit,
            hash: species.hash(),
            provenance,
            leaf_shape: leaf.shape.rank(),
            leaf_deform: leaf.deform.rank(),
            stem_deform: stem.deform.rank(),
            ranges: *ranges,
        }
    }
}

/// Components drawn.
const DRAWN: usize = 3;
/// Standard deviations drawn.
const SIGMAS: f64 = 2.0;
/// The picture, pixels.
const PICTURE: [u32; 2] = [1200, 700];

pub(super) fn run(args: &Args, output: &Output) -> Result<Exit, CommandError> {
    let species = files::species(&args.name)?;
    if let Some(path) = &args.picture {
        files::write(path, &studio::picture(specimens(&species), PICTURE, 1)?)?;
    }
    let summary = Summary::of(&species);
    if output.json {
        output.json(&summary)?;
        return Ok(Exit::Done);
    }
    let Summary { name, hash, provenance, leaf_shape, leaf_deform, stem_deform, ranges, .. } = &summary;
    let Ranges { blade_length, stem_length, stem_radius, blade_width } = ranges;
    let range = |Range { min, max }: &Range| format!("{min} .. {max}");
    output.text(&format!(
        "{name}, {habit}\n  hash          {hash}\n  provenance    {provenance}\n  \
         components    {leaf_shape} of leaf shape, {leaf_deform} of leaf deformation, {stem_deform} of stem deformation\n  \
         blade length  {} m\n  stem length   {} m\n  stem radius   {} m\n  blade width   {}\n",
        range(blade_length),
        range(stem_length),
        range(stem_radius),
        range(blade_width),
        habit = format!("{:?}", species.habit).to_lowercase(),
    ))?;
    Ok(Exit::Done)
}

/// Leaves of 10 cm stood side by side: below by shape, flat as far as the mean bend is; above by deformation.
fn specimens(species: &Species) -> Vec<(&Species, Plant)> {
    let ranks = [species.leaf.shape.rank(), species.leaf.deform.rank()];
    let widest = species.leaf.flat(&[], 1.0).iter().map(|p| p.x.abs()).fold(0.1, f64::max);
    let mut plants = Vec::new();
    for (row, rank) in ranks.into_iter().enumerate() {
        let mut pose = |column: usize, k: usize, c: f64| {
            let mut blade = Blade { beta: vec![0.0; ranks[0]], gamma: vec![0.0; ranks[1]], width: 1.0 };
            let coefficients = if row == 0 { &mut blade.beta } else { &mut blade.gamma };
            if let Some(coefficient) = coefficients.get_mut(k) {
                *coefficient = c;
            }
            let place = DVec3::new(column as f64 * widest * 0.3, 0.0, row as f64 * 0.13);
            plants.push((species, specimen(blade, place)));
        };
        pose(0, 0, 0.0);
        for k in 0..rank.min(DRAWN) {
            pose(2 * k + 1, k, -SIGMAS);
            pose(2 * k + 2, k, SIGMAS);
        }
    }
    plants
}

/// A 10 cm leaf that stands upright at `place`, its upper side to the front, on a stem too small to see.
fn specimen(blade: Blade, place: DVec3) -> Plant {
    let stem = Organ {
        parent: None,
        joint: Joint { d: 0.0, rotation: DQuat::IDENTITY, scale: 0.001 },
        form: Form::Stem { gamma: Vec::new(), radius: 0.001 },
    };
    let leaf = Organ {
        parent: Some(0),
        // +z, the upper side, comes to -y; +y, the tip, to +z.
        joint: Joint { d: 0.0, rotation: DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2), scale: 100.0 },
        form: Form::Leaf { blade, leaf: 0 },
    };
    Plant { world_from_plant: Pose::new(DQuat::IDENTITY, place), organs: vec![stem, leaf] }
}
