//! `demeter eval leaf`: how near one blade comes to its points, how fast, beside loose surfaces.

use std::collections::BTreeMap;
use std::path::PathBuf;

use demeter_recon::baseline::{bezier, quadratic};
use demeter_recon::fit;
use demeter_recon::metrics::chamfer;
use demeter_recon::model::{Detail, Knots, OrganKind, PlantMesh, Species};
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::statistics::quantile;
use glam::DVec3;
use rustix::time::{ClockId, clock_gettime};

use super::baselines::numbers;
use super::clouds::{read, some, species_of};
use super::table::{Cell, Table};
use super::{files_of, folder, progress};
use crate::error::CommandError;
use crate::files;

/// Arguments of `demeter eval leaf`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder of labelled clouds whose file or folder names begin with their species, millimetres; by default the
    /// shared organ-clouds.
    #[arg(long)]
    clouds: Option<PathBuf>,
    /// Take every N-th cloud.
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Leave the Bézier surface and the quadratic patch out.
    #[arg(long)]
    quick: bool,
}

/// Fewest points of a leaf that counts.
const MIN_POINTS: usize = 200;
/// Points of the leaves whose time has a goal.
const TIMED: std::ops::RangeInclusive<usize> = 1_500..=2_000;
/// Issue 3: median CD over the leaf's diagonal on tobacco; median and 99th percentile of a fit's time, milliseconds.
const GOAL: (&str, f64) = ("tobacco", 0.0080);
const GOAL_MS: (f64, f64) = (15.0, 60.0);
const OURS: &str = "Demeter";

/// What a method made of one leaf.
struct Scored {
    cd: f64,
    points: usize,
    /// Processor time, milliseconds; of our own fit alone.
    ms: Option<f64>,
}

pub(super) fn table(args: &Args) -> Result<Table, CommandError> {
    let columns = [
        "species",
        "method",
        "leaves",
        "CD q1",
        "CD median",
        "CD q3",
        "goal CD",
        "ms median",
        "ms p99",
        "timed leaves",
        "timed ms median",
        "timed ms p99",
    ];
    let mut table = Table::new("leaf", &columns);
    let paths = some(files_of(&folder(args.clouds.as_ref(), "organ-clouds", "--clouds")?, "ply")?, args.every);
    let bar = progress(paths.len());
    let mut scores: BTreeMap<(&str, &str), Vec<Scored>> = BTreeMap::new();
    for path in paths {
        bar.inc(1);
        let Some(name) = species_of(&path) else { continue };
        let species = files::species(name)?;
        let segmented = match segment(&read(&path, 1e-3)?, &species, Labels::Own, Up::Auto) {
            Ok(segmented) => segmented,
            Err(reason) => {
                table.notes.push(format!("{}: {reason}", path.display()));
                continue;
            }
        };
        let leaves = segmented.organs.iter().filter(|o| o.kind == OrganKind::Leaf && o.points.len() >= MIN_POINTS);
        for leaf in leaves {
            for (method, scored) in methods(&leaf.points, segmented.up, &species, args.quick) {
                match scored {
                    Some(scored) => scores.entry((name, method)).or_default().push(scored),
                    None => table.notes.push(format!("{}, {method}: a leaf without a fit", path.display())),
                }
            }
        }
    }
    table.rows = scores.iter().map(|((species, method), scores)| row(species, method, scores)).collect();
    let (median, p99) = GOAL_MS;
    table.notes.push(format!(
        "leaves of {MIN_POINTS} points and more; CD over the leaf's diagonal; processor time of one core; timed are leaves \
         of {} to {} points, goals {median} and {p99} ms",
        TIMED.start(),
        TIMED.end()
    ));
    Ok(table)
}

fn methods(points: &[DVec3], up: DVec3, species: &Species, quick: bool) -> Vec<(&'static str, Option<Scored>)> {
    let scored = |mesh: &PlantMesh, ms| Some(Scored { cd: chamfer(points, mesh)?.cd, points: points.len(), ms });
    let started = processor_ms();
    let fitted = fit::lone_blade(points, None, up, species);
    let ms = processor_ms() - started;
    let ours = fitted
        .ok()
        .and_then(|blade| scored(&PlantMesh::of(&blade.posed(species), Detail::Control, Knots::Uniform), Some(ms)));
    let mut found = vec![(OURS, ours)];
    if !quick {
        let as_many = numbers(OrganKind::Leaf, species);
        found.push(("Bézier, as many numbers", scored(&bezier(points, as_many), None)));
        found.push(("quadratic", scored(&quadratic(points), None)));
    }
    found
}

/// Time that this thread has spent on a processor, milliseconds: other work on the machine does not lengthen it.
pub(super) fn processor_ms() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

fn row(species: &str, method: &str, scores: &[Scored]) -> Vec<Cell> {
    let cds: Vec<f64> = scores.iter().map(|scored| scored.cd).collect();
    let all: Vec<f64> = scores.iter().filter_map(|scored| scored.ms).collect();
    let timed: Vec<f64> = scores.iter().filter(|s| TIMED.contains(&s.points)).filter_map(|s| s.ms).collect();
    let goal = (GOAL.0 == species && method == OURS).then_some(GOAL.1);
    vec![
        species.into(),
        method.into(),
        Cell::Count(scores.len()),
        Cell::figure(quantile(&cds, 0.25), 4),
        Cell::figure(quantile(&cds, 0.5), 4),
        Cell::figure(quantile(&cds, 0.75), 4),
        Cell::figure(goal, 4),
        Cell::figure(quantile(&all, 0.5), 1),
        Cell::figure(quantile(&all, 0.99), 1),
        Cell::Count(timed.len()),
        Cell::figure(quantile(&timed, 0.5), 1),
        Cell::figure(quantile(&timed, 0.99), 1),
    ]
}
