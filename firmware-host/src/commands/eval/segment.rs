//! `demeter eval segment`: clouds divided into organs as if they had no labels, beside their labels.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use demeter_recon::cloud::{PointCloud, PointOrgan};
use demeter_recon::metrics::{Division, MIN_SEEN_POINTS, stems_merged};
use demeter_recon::model::OrganKind;
use demeter_recon::segment::{Labels, Up};
use demeter_recon::statistics::mean;
use glam::DVec3;

use super::clouds::{read, some, species_of};
use super::release::{self, Released};
use super::table::{Cell, Table};
use super::{files_of, folder, picture, progress};
use crate::divider::{Divided, Divider, OrganSource};
use crate::error::CommandError;
use crate::files;

/// Arguments of `demeter eval segment`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folders of labelled clouds whose file or folder names begin with their species, z up; organ-clouds of the shared
    /// data when nothing else is asked for. Clouds with `organ` and `kind` have their stems apart.
    #[arg(long, num_args = 1..)]
    clouds: Vec<PathBuf>,
    /// A species' folder of the authors' release: points on the surfaces of its plants, stems apart.
    #[arg(long)]
    release: Option<PathBuf>,
    /// Length of the given clouds' unit, metres.
    #[arg(long, default_value_t = 1.0)]
    metres: f64,
    /// Take this species alone.
    #[arg(long)]
    species: Option<String>,
    /// Take every N-th cloud.
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// What finds the organs; both, a row each, when not given.
    #[arg(long, value_enum)]
    organs: Option<OrganSource>,
    /// Draw the truth of each cloud beside what was found into this folder. Pictures of the shared data stay out of the
    /// project.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
}

/// Goals of issue 4, each at least.
const GOALS: [(&str, f64); 5] =
    [("precision", 0.80), ("recall", 0.72), ("stem/leaf IoU", 0.85), ("blades within 1", 0.80), ("right stems", 0.9)];

/// A cloud whose organs are known.
struct Case {
    path: PathBuf,
    /// What the table calls it.
    name: String,
    /// The species it is taken for.
    species: &'static str,
    cloud: PointCloud,
    truth: Vec<PointOrgan>,
    up: Up,
}

/// Sums over the clouds of one row.
#[derive(Default)]
struct Sums {
    clouds: usize,
    division: Division,
    /// Of these, the clouds whose truth has stems apart.
    apart: Division,
    /// Found less true blades, a cloud each.
    blades: Vec<f64>,
}

pub(super) fn table(args: &Args) -> Result<Table, CommandError> {
    let columns = [
        "species",
        "organs by",
        "clouds",
        "instances",
        "precision",
        "recall",
        "coverage",
        "stem/leaf IoU",
        "blade error",
        "blades within 1",
        "right stems",
    ];
    let mut table = Table::new("segment", &columns);
    let mut rows: BTreeMap<(String, OrganSource), Sums> = BTreeMap::new();
    let sources = args.organs.map_or(vec![OrganSource::Network, OrganSource::Geometry], |source| vec![source]);
    let mut dividers: Vec<(OrganSource, Divider)> = sources.into_iter().map(|by| (by, Divider::new(by))).collect();
    let paths = args.clouds()?;
    let bar = progress(paths.len());
    let released = args.release.iter().map(release::plants).collect::<Result<Vec<_>, _>>()?;
    let released = released.into_iter().flatten().map(|plant| Ok(Some(Case::released(plant))));
    for case in paths.iter().map(|(path, metres, up)| Case::read(path, *metres, *up)).chain(released) {
        bar.inc(1);
        let Some(case) = case? else { continue };
        for (by, divider) in &mut dividers {
            let segmented = match case.divided(divider) {
                Ok(Divided { segmented, degraded: None, .. }) => segmented,
                // The row would be geometry's; one cloud says why there is none.
                Ok(Divided { degraded: Some(reason), .. }) => {
                    if !table.notes.contains(&reason) {
                        table.notes.push(reason);
                    }
                    continue;
                }
                Err(reason) => {
                    table.notes.push(format!("{}: {reason}", case.path.display()));
                    continue;
                }
            };
            let found = segmented.of_points(case.truth.len());
            if let Some(folder) = &args.pictures {
                let name = case.path.file_stem().unwrap_or_default().to_string_lossy();
                let path = folder.join(format!("{name}-{}.png", by.name()));
                picture::divisions(&path, &case.cloud.points, segmented.up, [&case.truth, &found])?;
            }
            for name in [case.name.as_str(), "all"] {
                rows.entry((name.into(), *by)).or_default().add(&case, &found);
            }
        }
    }
    table.rows = rows.iter().map(|((name, by), sums)| sums.row(name, *by)).collect();
    let goals = GOALS.map(|(name, goal)| format!("{name} {goal:.2}")).join(", ");
    table.notes.push(format!("goals, at least: {goals}"));
    table.notes.push(format!(
        "an instance is a blade (a leaflet too) or a stem, petioles and rachises being stems, of {MIN_SEEN_POINTS} points \
         and more; stems are one where the truth has them as one; blade error: mean of |found - true| a cloud; right \
         stems: share of true stem points found to be the main stem's or others'"
    ));
    Ok(table)
}

impl Args {
    /// Every labelled cloud asked for with the length of its unit in metres and its vertical.
    fn clouds(&self) -> Result<Vec<(PathBuf, f64, Up)>, CommandError> {
        let mut sets = Vec::new();
        for path in &self.clouds {
            sets.push((folder(Some(path), "", "--clouds")?, self.metres, Up::Axis(DVec3::Z)));
        }
        if sets.is_empty() && self.release.is_none() {
            sets.push((folder(None, "organ-clouds", "--clouds")?, 1e-3, Up::Auto));
        }
        let wanted = |path: &PathBuf| self.species.as_deref().is_none_or(|name| species_of(path) == Some(name));
        let mut clouds = Vec::new();
        for (path, metres, up) in sets {
            let files = files_of(&path, "ply")?.into_iter().filter(wanted).collect();
            clouds.extend(some(files, self.every).into_iter().map(|path| (path, metres, up)));
        }
        Ok(clouds)
    }
}

impl Case {
    /// `None` of a species that does not ship.
    fn read(path: &Path, metres: f64, up: Up) -> Result<Option<Self>, CommandError> {
        let Some(species) = species_of(path) else { return Ok(None) };
        let cloud = read(path, metres)?;
        let of_label = |label: &i32| match label {
            ..=0 => PointOrgan { organ: 0, kind: OrganKind::MainStem },
            _ => PointOrgan { organ: *label, kind: OrganKind::Leaf },
        };
        let Some(truth) = cloud
            .organs
            .clone()
            .or_else(|| Some(cloud.labels.iter().flatten().map(of_label).collect()))
            .filter(|truth: &Vec<_>| truth.len() == cloud.points.len())
        else {
            let message = format!("{}: expected `label`, or `organ` and `kind`, found neither", path.display());
            return Err(CommandError::usage("truth", message));
        };
        Ok(Some(Self { path: path.into(), name: species.into(), species, cloud, truth, up }))
    }

    fn released(Released { folder, cloud, .. }: Released) -> Self {
        let truth = cloud.organs.clone().unwrap_or_default();
        Self { path: folder, name: release::NAME.into(), species: "soybean", cloud, truth, up: Up::Axis(DVec3::Z) }
    }

    fn divided(&self, divider: &mut Divider) -> Result<Divided, CommandError> {
        divider
            .divide(&self.cloud, &files::species(self.species)?, Labels::None, self.up)
            .map_err(|error| CommandError::failed("segmentation", &error))
    }

    /// Whether the truth tells stems apart.
    fn stems_apart(&self) -> bool {
        self.truth.iter().any(|point| point.organ >= 0 && point.kind == OrganKind::Stem)
    }
}

impl Sums {
    fn add(&mut self, case: &Case, found: &[PointOrgan]) {
        if case.stems_apart() {
            let division = Division::of(found, &case.truth);
            self.division.add(&division);
            self.apart.add(&division);
        } else {
            self.division.add(&Division::of(&stems_merged(found), &case.truth));
        }
        self.clouds += 1;
        self.blades.push(blades(found) - blades(&case.truth));
    }

    fn row(&self, name: &str, by: OrganSource) -> Vec<Cell> {
        let division = &self.division;
        vec![
            name.into(),
            by.name().into(),
            Cell::Count(self.clouds),
            Cell::Count(division.truth),
            Cell::figure(division.precision(), 3),
            Cell::figure(division.recall(), 3),
            Cell::figure(division.coverage(), 3),
            Cell::figure(division.semantic_iou(), 3),
            Cell::figure(mean(self.blades.iter().map(|miss| miss.abs())), 2),
            Cell::figure(mean(self.blades.iter().map(|miss| f64::from(miss.abs() <= 1.0))), 2),
            Cell::figure(self.apart.right_stems(), 3),
        ]
    }
}

/// Blades of [`MIN_SEEN_POINTS`] and more.
fn blades(points: &[PointOrgan]) -> f64 {
    let mut sizes: BTreeMap<i32, usize> = BTreeMap::new();
    let leaves = points.iter().filter(|point| point.organ >= 0 && point.kind == OrganKind::Leaf);
    leaves.for_each(|point| *sizes.entry(point.organ).or_default() += 1);
    sizes.values().filter(|size| **size >= MIN_SEEN_POINTS).count() as f64
}
