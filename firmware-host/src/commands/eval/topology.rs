//! `demeter eval topology`: organs known and apart, is each on the right parent?

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use demeter_recon::cloud::PointCloud;
use demeter_recon::metrics::{MIN_SEEN_POINTS, Parents, right_parents};
use demeter_recon::organs::{OrganCloud, OrganTree};
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::{species, tree};
use glam::DVec3;

use super::clouds::read;
use super::release::{self, Released};
use super::table::{Cell, Table};
use super::truth::Truth;
use super::{files_of, progress};
use crate::error::CommandError;
use crate::files;

/// Goal of issue 3: share of organs with the right parent.
const GOAL: f64 = 0.95;

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
        "organs are given apart, with their kinds; every organ of {MIN_SEEN_POINTS} points and more but the main stem counts"
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
        cases.push(Case {
            found: parents(&read(&cloud_path, 1.0)?, &truth.species, &cloud_path)?,
            truth: truth.organs.iter().map(|organ| (organ.id, organ.parent)).collect(),
            seen: truth.organs.iter().filter(|organ| organ.points >= MIN_SEEN_POINTS).map(|organ| organ.id).collect(),
            species: truth.species,
        });
    }
    Ok(())
}

/// Plants that the authors fitted.
fn released(folder: &PathBuf, cases: &mut Vec<Case>) -> Result<(), CommandError> {
    for Released { folder, raw, cloud } in release::plants(folder)? {
        let mut points: BTreeMap<i32, usize> = BTreeMap::new();
        cloud.organs.iter().flatten().for_each(|point| *points.entry(point.organ).or_default() += 1);
        cases.push(Case {
            found: parents(&cloud, "soybean", &folder)?,
            truth: (0..).zip(&raw.organs).map(|(id, organ)| (id, organ.parent.map(|parent| parent as i32))).collect(),
            seen: points.into_iter().filter(|(_, n)| *n >= MIN_SEEN_POINTS).map(|(id, _)| id).collect(),
            species: release::NAME.into(),
        });
    }
    Ok(())
}

/// Parents in the tree made of a cloud's own organs, by their numbers.
fn parents(cloud: &PointCloud, species: &str, path: &Path) -> Result<Parents, CommandError> {
    let Some(organ_of_point) = &cloud.organs else {
        let message = format!("{}: expected the properties `organ` and `kind`, found none", path.display());
        return Err(CommandError::usage("truth", message));
    };
    let organs = segment(cloud, &files::species(species)?, Labels::Auto, Up::Axis(DVec3::Z))
        .map_err(|error| CommandError::failed("segmentation", &error).of(path))?
        .organs;
    let OrganTree { organs, parent } =
        tree::build(organs).map_err(|error| CommandError::failed("topology", &error).of(path))?;
    let number = |organ: &OrganCloud| organ.source.first().map_or(-1, |point| organ_of_point[*point as usize].organ);
    let numbers: Vec<i32> = organs.iter().map(number).collect();
    Ok(numbers.iter().zip(&parent).map(|(organ, parent)| (*organ, parent.map(|parent| numbers[parent]))).collect())
}
