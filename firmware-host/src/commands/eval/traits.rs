//! `demeter eval traits`: traits of the decoded record against the truth that tools/helios/grow.py wrote.

use std::collections::BTreeMap;
use std::path::PathBuf;

use demeter_recon::metrics::{Agreement, Pair};
use demeter_recon::segment::{Labels, Up};
use demeter_recon::species;
use demeter_recon::statistics::median;
use demeter_recon::traits::keys;
use glam::DVec3;

use super::clouds::{Fitted, read, some, whole};
use super::table::{Cell, Table};
use super::truth::{Kind, Truth};
use super::{files_of, folder, progress};
use crate::divider::{Divider, OrganSource};
use crate::error::CommandError;
use crate::files;

/// Arguments of `demeter eval traits`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder that tools/helios/grow.py wrote: clouds with labels, the truth beside each.
    #[arg(long)]
    truth: PathBuf,
    /// Blades of fewer points are left out and counted: 100 is the least the paper takes for a leaf.
    #[arg(long, default_value_t = 100)]
    min_points: usize,
    /// Take every N-th plant.
    #[arg(long, default_value_t = 1)]
    every: usize,
}

/// Seen shares of blades that are told apart.
const BANDS: [(f64, f64, &str); 4] =
    [(0.0, 1.0 / 3.0, "0-1/3"), (1.0 / 3.0, 2.0 / 3.0, "1/3-2/3"), (2.0 / 3.0, 1.1, "2/3-1"), (0.6, 1.1, ">= 0.6")];
/// Nodes of the main stem nearer than this are one, metres.
const SAME_NODE: f64 = 1e-3;

/// What is compared: a trait's key, the factor and unit in which it is shown, its goals.
struct Measure {
    key: &'static str,
    unit: &'static str,
    factor: f64,
    /// Goal on clean clouds, on spoiled ones where 60 % is seen.
    goals: [Option<&'static str>; 2],
}

const MEASURES: [Measure; 5] = [
    Measure {
        key: keys::LEAF_AREA,
        unit: "cm2",
        factor: 1e4,
        goals: [Some("MAPE <= 6 %"), Some("MAPE <= 15 % where >= 0.6 seen; 95 % intervals 90-98 %")],
    },
    Measure { key: keys::LEAF_LENGTH, unit: "mm", factor: 1e3, goals: [Some("RMSE <= 5 mm"), None] },
    Measure {
        key: keys::LEAF_INCLINATION,
        unit: "deg",
        factor: 180.0 / std::f64::consts::PI,
        goals: [Some("RMSE <= 3 deg"), None],
    },
    Measure { key: keys::HEIGHT, unit: "mm", factor: 1e3, goals: [Some("RMSE <= 5 mm"), None] },
    Measure { key: keys::INTERNODE_LENGTH, unit: "mm", factor: 1e3, goals: [Some("RMSE <= 5 mm"), None] },
];

/// A compared value: where it belongs and what it is.
struct Sample {
    species: String,
    key: &'static str,
    /// Share of the blade that was in the cloud, of blades.
    visible: Option<f64>,
    pair: Pair,
}

pub(super) fn table(args: &Args) -> Result<Table, CommandError> {
    let columns = ["trait", "species", "seen", "n", "bias", "RMSE", "unit", "MAPE %", "R2", "in 95 %", "goal"];
    let mut table = Table::new("traits", &columns);
    let paths = some(files_of(&folder(Some(&args.truth), "", "--truth")?, "json")?, args.every);
    let bar = progress(paths.len());
    let mut divider = Divider::new(OrganSource::Geometry);
    let (mut samples, mut spoiled, mut blades, mut small, mut unfitted) = (Vec::new(), false, 0, 0, 0);
    for path in paths {
        bar.inc(1);
        let (truth, cloud_path) = Truth::read(&path)?;
        if !species::NAMES.contains(&truth.species.as_str()) {
            continue;
        }
        spoiled |= truth.noise_m > 0.0 || truth.missing > 0.0;
        let cloud = read(&cloud_path, 1.0)?;
        let fitted =
            match whole(&cloud, &files::species(&truth.species)?, &mut divider, Labels::Own, Up::Axis(DVec3::Z)) {
                Ok(fitted) => fitted,
                Err(reason) => {
                    table.notes.push(format!("{}: {reason}", cloud_path.display()));
                    continue;
                }
            };
        let labels = cloud.labels.unwrap_or_default();
        let matched = matched(&fitted, &truth, |point| labels.get(point as usize).copied().unwrap_or(0));
        for organ in truth.organs.iter().filter(|organ| organ.kind == Kind::Blade) {
            blades += 1;
            if organ.points < args.min_points {
                small += 1;
            } else if !matched.contains_key(&organ.id) {
                unfitted += 1;
            }
        }
        let enough = matched.into_iter().filter(|(id, _)| truth.organs[*id as usize].points >= args.min_points);
        compare(&truth, &fitted, &enough.collect(), &mut samples);
    }
    fill(&mut table, &samples, usize::from(spoiled));
    table.notes.insert(0, format!(
        "{blades} blades; {small} of them with fewer than {} points and {unfitted} that were not fitted are left out",
        args.min_points
    ));
    Ok(table)
}

/// The record's organ of each blade of the truth, by the label of the points it was fitted to.
fn matched(fitted: &Fitted, truth: &Truth, label: impl Fn(u32) -> i32) -> BTreeMap<i32, usize> {
    let of_label: BTreeMap<i32, usize> = (fitted.source.iter().enumerate())
        .filter_map(|(organ, source)| Some((label(*fitted.tree.organs[(*source)?].source.first()?), organ)))
        .collect();
    let blades = truth.organs.iter().filter(|organ| organ.kind == Kind::Blade);
    blades.filter_map(|organ| Some((organ.id, *of_label.get(&organ.label)?))).collect()
}

/// Adds every pair of a plant.
fn compare(truth: &Truth, fitted: &Fitted, matched: &BTreeMap<i32, usize>, samples: &mut Vec<Sample>) {
    let report = &fitted.described.report;
    let mut add = |key, visible, truth_value, measured: Option<(f64, Option<f64>)>| {
        if let Some((measured, sigma)) = measured {
            let pair = Pair { truth: truth_value, measured, sigma };
            samples.push(Sample { species: truth.species.clone(), key, visible, pair });
        }
    };
    for (id, organ) in matched {
        let blade = &truth.organs[*id as usize];
        let values = [
            (keys::LEAF_AREA, blade.area),
            (keys::LEAF_LENGTH, blade.length),
            (keys::LEAF_INCLINATION, blade.inclination),
        ];
        for (key, value) in values {
            let measured = report.organs[*organ].traits.get(key).map(|quantity| (quantity.value, quantity.sigma));
            add(key, Some(blade.visible), value, measured);
        }
    }
    let height = report.traits.get(keys::HEIGHT).map(|quantity| (quantity.value, quantity.sigma));
    add(keys::HEIGHT, None, truth.height, height);
    for (expected, found) in internodes(truth, fitted, matched) {
        add(keys::INTERNODE_LENGTH, None, expected, Some((found, None)));
    }
}

/// Lengths between successive nodes of the main stem that carry a fitted blade, true and found, metres.
fn internodes(truth: &Truth, fitted: &Fitted, matched: &BTreeMap<i32, usize>) -> Vec<(f64, f64)> {
    let plant = &fitted.described.plant;
    let on_main = |mut organ: usize| loop {
        match plant.organs[organ].parent? {
            0 => return Some(plant.organs[organ].joint.d * plant.organs[0].joint.scale),
            parent => organ = parent,
        }
    };
    // Place of each blade's node on the true and on the found stem. Of a node's blades one may hang on a stem that it
    // merely touches, so that the node is where most of them are.
    let mut nodes: Vec<(f64, f64)> = (matched.iter())
        .filter_map(|(id, organ)| {
            let hung = truth.on_main_stem(*id as usize)?;
            Some((truth.organs[hung].attach, on_main(*organ)?))
        })
        .collect();
    nodes.push((0.0, 0.0));
    nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let nodes: Vec<(f64, f64)> = nodes
        .chunk_by(|earlier, later| later.0 - earlier.0 < SAME_NODE)
        .filter_map(|node| Some((node[0].0, median(node.iter().map(|(_, found)| found))?)))
        .collect();
    nodes.windows(2).map(|pair| (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1)).collect()
}

/// A row for each trait and species, for all of them together, and for the shares that were seen.
fn fill(table: &mut Table, samples: &[Sample], spoiled: usize) {
    let species: std::collections::BTreeSet<&str> = samples.iter().map(|sample| sample.species.as_str()).collect();
    for measure in MEASURES {
        let own: Vec<&Sample> = samples.iter().filter(|sample| sample.key == measure.key).collect();
        for name in &species {
            let of_species = own.iter().filter(|sample| sample.species == *name).map(|sample| sample.pair);
            table.rows.extend(row(&measure, name, "all", of_species.collect(), None));
        }
        let goal = measure.goals[spoiled];
        table.rows.extend(row(&measure, "all", "all", own.iter().map(|sample| sample.pair).collect(), goal));
        for (low, high, name) in BANDS.iter().filter(|_| spoiled == 1) {
            let inside = own.iter().filter(|sample| sample.visible.is_some_and(|seen| (*low..*high).contains(&seen)));
            table.rows.extend(row(&measure, "all", name, inside.map(|sample| sample.pair).collect(), goal));
        }
    }
}

fn row(measure: &Measure, species: &str, seen: &str, pairs: Vec<Pair>, goal: Option<&str>) -> Option<Vec<Cell>> {
    let found = Agreement::of(&pairs)?;
    Some(vec![
        measure.key.into(),
        species.into(),
        seen.into(),
        Cell::Count(found.count),
        Cell::Figure(found.bias * measure.factor, 2),
        Cell::Figure(found.rmse * measure.factor, 2),
        measure.unit.into(),
        Cell::figure(found.mape.map(|share| share * 100.0), 1),
        Cell::figure(found.r2, 3),
        Cell::figure(found.coverage.map(|share| share * 100.0), 1),
        goal.unwrap_or("").into(),
    ])
}
