//! `demeter eval topology`: organs known and apart, is each on the right parent?

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use demeter_recon::import::release::{RawForm, RawPlant};
use demeter_recon::metrics::{Parents, SURFACE_SAMPLES, right_parents, sample_surface};
use demeter_recon::model::{Detail, Knots, OrganKind, PlantMesh};
use demeter_recon::organs::{OrganCloud, OrganTree};
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::{species, tree};
use glam::DVec3;

use super::clouds::read;
use super::table::{Cell, Table};
use super::truth::Truth;
use super::{files_of, folder, progress};
use crate::commands::import::{bases, release_plant};
use crate::error::CommandError;
use crate::files;

/// Goal of issue 3: share of organs with the right parent.
const GOAL: f64 = 0.95;
/// An organ of fewer points is none to a scan: buds, and what occlusion left of others.
const MIN_POINTS: usize = 12;

/// Arguments of `demeter eval topology`.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = true)]
pub(super) struct Args {
    /// Folder that tools/helios/grow.py wrote: clouds with the properties `organ` and `kind`, truth beside each.
    #[arg(long)]
    truth: Option<PathBuf>,
    /// A species' folder of the authors' release: points on the surfaces of its plants, against its own trees.
    #[arg(long)]
    release: Option<PathBuf>,
}

/// A plant whose organs were put together again, and how they should have been.
struct Case {
    species: String,
    found: Parents,
    truth: Parents,
    /// Organs that count.
    seen: BTreeSet<i32>,
}

pub(super) fn table(args: &Args) -> Result<Table, CommandError> {
    let mut cases = Vec::new();
    if let Some(folder) = &args.truth {
        grown(folder, &mut cases)?;
    }
    if let Some(folder) = &args.release {
        released(folder, &mut cases)?;
    }
    let mut counts: BTreeMap<&str, (usize, usize, usize)> = BTreeMap::new();
    for case in &cases {
        let (right, count) = right_parents(&case.found, &case.truth, &case.seen);
        for name in [case.species.as_str(), "all"] {
            let sums = counts.entry(name).or_default();
            *sums = (sums.0 + 1, sums.1 + count, sums.2 + right);
        }
    }
    let mut table = Table::new("topology", &["species", "plants", "organs", "right parent", "goal at least"]);
    for (name, (plants, organs, right)) in counts {
        let share = (organs > 0).then(|| right as f64 / organs as f64);
        table.rows.push(vec![
            Cell::Text(name.into()),
            Cell::Count(plants),
            Cell::Count(organs),
            Cell::figure(share, 3),
            Cell::Figure(GOAL, 2),
        ]);
    }
    table.notes.push(format!(
        "organs are given apart, with their kinds; every organ of {MIN_POINTS} points and more but the main stem counts"
    ));
    Ok(table)
}

/// Plants that tools/helios grew.
fn grown(folder: &PathBuf, cases: &mut Vec<Case>) -> Result<(), CommandError> {
    let paths = files_of(&super::folder(Some(folder), "", "--truth")?, "json")?;
    let bar = progress(paths.len());
    for path in paths {
        bar.inc(1);
        let (truth, cloud_path) = Truth::read(&path)?;
        if !species::NAMES.contains(&truth.species.as_str()) {
            continue;
        }
        let cloud = read(&cloud_path, 1.0)?;
        let species = files::species(&truth.species)?;
        let organs = segment(&cloud, &species, Labels::Auto, Up::Axis(DVec3::Z))
            .map_err(|error| CommandError::failed("segmentation", &error).of(&cloud_path))?
            .organs;
        let Some(organ_of_point) = &cloud.organs else {
            let message = format!("{}: expected the properties `organ` and `kind`, found none", cloud_path.display());
            return Err(CommandError::usage("truth", message));
        };
        cases.push(Case {
            found: parents(organs, &cloud_path, |point| organ_of_point[point as usize].organ)?,
            truth: truth.organs.iter().map(|organ| (organ.id, organ.parent)).collect(),
            seen: truth.organs.iter().filter(|organ| organ.points >= MIN_POINTS).map(|organ| organ.id).collect(),
            species: truth.species,
        });
    }
    Ok(())
}

/// Plants that the authors fitted.
fn released(release: &PathBuf, cases: &mut Vec<Case>) -> Result<(), CommandError> {
    let release = folder(Some(release), "", "--release")?;
    let bases = bases(&release)?;
    for path in files_of(&release, "pkl")? {
        let plant_folder = path.parent().unwrap_or(&release);
        let raw = RawPlant::of(&release_plant(plant_folder)?, &bases);
        let posed = raw.pose().map_err(|error| CommandError::failed("release", &error).of(plant_folder))?;
        let mesh = PlantMesh::of(&posed, Detail::Control, Knots::Uniform);
        let mut organs: Vec<OrganCloud> = raw
            .organs
            .iter()
            .map(|organ| OrganCloud {
                kind: match (&organ.form, organ.parent) {
                    (RawForm::Leaf { .. }, _) => OrganKind::Leaf,
                    (RawForm::Stem { .. }, None) => OrganKind::MainStem,
                    (RawForm::Stem { .. }, Some(_)) => OrganKind::Stem,
                },
                points: Vec::new(),
                source: Vec::new(),
            })
            .collect();
        for (point, face) in sample_surface(&mesh, SURFACE_SAMPLES, 1) {
            let id = mesh.organ_of_face[face];
            organs[id as usize].points.push(point);
            organs[id as usize].source.push(id);
        }
        let seen: Vec<usize> = (0..organs.len()).filter(|id| organs[*id].points.len() >= MIN_POINTS).collect();
        organs.retain(|organ| !organ.points.is_empty());
        cases.push(Case {
            species: "soybean, the release's".into(),
            found: parents(organs, plant_folder, |id| id as i32)?,
            truth: (0..).zip(&raw.organs).map(|(id, organ)| (id, organ.parent.map(|parent| parent as i32))).collect(),
            seen: seen.into_iter().map(|id| id as i32).collect(),
        });
    }
    Ok(())
}

/// Parents in the tree made of the organs, by the ids that `id` gives what their points came from.
fn parents(organs: Vec<OrganCloud>, path: &Path, id: impl Fn(u32) -> i32) -> Result<Parents, CommandError> {
    let OrganTree { organs, parent } =
        tree::build(organs).map_err(|error| CommandError::failed("topology", &error).of(path))?;
    let ids: Vec<i32> = organs.iter().map(|organ| organ.source.first().map_or(-1, |point| id(*point))).collect();
    Ok(ids.iter().zip(&parent).map(|(organ, parent)| (*organ, parent.map(|parent| ids[parent]))).collect())
}
