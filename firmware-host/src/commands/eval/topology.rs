//! `demeter eval topology`: organs known and apart, is each on the right parent?

use std::collections::BTreeMap;
use std::path::PathBuf;

use demeter_recon::metrics::{Parents, right_parents};
use demeter_recon::organs::OrganTree;
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::{species, tree};
use glam::DVec3;

use super::clouds::read;
use super::table::{Cell, Table};
use super::truth::Truth;
use super::{files_of, folder, progress};
use crate::error::CommandError;
use crate::files;

/// Goal of issue 3: share of organs with the right parent.
const GOAL: f64 = 0.95;
/// An organ of fewer points is none to a scan: buds, and what occlusion left of others.
const MIN_POINTS: usize = 12;

/// Arguments of `demeter eval topology`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder that tools/helios/grow.py wrote: clouds with the properties `organ` and `kind`, truth beside each.
    #[arg(long)]
    truth: PathBuf,
}

pub(super) fn table(args: &Args) -> Result<Table, CommandError> {
    let mut counts: BTreeMap<String, (usize, usize, usize)> = BTreeMap::new();
    let mut table = Table::new("topology", &["species", "plants", "organs", "right parent", "goal at least"]);
    let paths = files_of(&folder(Some(&args.truth), "", "--truth")?, "json")?;
    let bar = progress(paths.len());
    for path in paths {
        bar.inc(1);
        let (truth, cloud_path) = Truth::read(&path)?;
        if !species::NAMES.contains(&truth.species.as_str()) {
            continue;
        }
        let species = files::species(&truth.species)?;
        let cloud = read(&cloud_path, 1.0)?;
        let organs = segment(&cloud, species.habit, Labels::Auto, Up::Axis(DVec3::Z))
            .map_err(|error| CommandError::failed("segmentation", &error).of(&cloud_path))?
            .organs;
        let tree = tree::build(organs).map_err(|error| CommandError::failed("topology", &error).of(&cloud_path))?;
        let Some(organ_of_point) = &cloud.organs else {
            let message = format!("{}: expected the properties `organ` and `kind`, found none", cloud_path.display());
            return Err(CommandError::usage("truth", message));
        };
        let found = parents(&tree, |point| organ_of_point[point as usize].organ);
        let parents = truth.organs.iter().map(|organ| (organ.id, organ.parent)).collect();
        let seen = truth.organs.iter().filter(|organ| organ.points >= MIN_POINTS).map(|organ| organ.id).collect();
        let (right, count) = right_parents(&found, &parents, &seen);
        for name in [truth.species.as_str(), "all"] {
            let sums = counts.entry(name.into()).or_default();
            *sums = (sums.0 + 1, sums.1 + count, sums.2 + right);
        }
    }
    for (name, (plants, organs, right)) in counts {
        let share = (organs > 0).then(|| right as f64 / organs as f64);
        table.rows.push(vec![
            Cell::Text(name),
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

/// The tree's parents by the ids that `id` gives the organs' points.
fn parents(tree: &OrganTree, id: impl Fn(u32) -> i32) -> Parents {
    let ids: Vec<i32> = tree.organs.iter().map(|organ| organ.source.first().map_or(-1, |point| id(*point))).collect();
    ids.iter().zip(&tree.parent).map(|(organ, parent)| (*organ, parent.map(|parent| ids[parent]))).collect()
}
