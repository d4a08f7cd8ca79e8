//! Clouds that teach: which they are, what each gave, what was refused and why.

use std::path::{Path, PathBuf};

use demeter_recon::cloud::PointCloud;
use demeter_recon::learn::{Lesson, blade_errors};
use demeter_recon::model::Species;
use demeter_recon::segment::{Labels, Up, segment};
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde_json::json;

use crate::error::{CommandError, Exit, chain};
use crate::files;
use crate::output::Output;

/// Where a species is learned from and where it goes.
#[derive(Debug, clap::Args)]
pub(super) struct Source {
    /// Clouds. A plant: PLY in metres, z up, with `organ` and `kind` as `demeter fit --points` writes them, or with
    /// `label`. One leaf: any other PLY, or text with x y z first, in any unit.
    #[arg(required = true)]
    clouds: Vec<PathBuf>,
    /// The species to start from: a name, or a file.
    #[arg(long)]
    from: String,
    /// Where the species that was learned goes (.safetensors).
    #[arg(short, long)]
    output: PathBuf,
    /// Where the clouds come from and under which licence, for the species' provenance.
    #[arg(long)]
    credit: Option<String>,
}

/// What all clouds gave.
pub(super) struct Class {
    /// One a cloud, in order; that of a cloud that teaches nothing is empty.
    pub(super) lessons: Vec<Lesson>,
    pub(super) told: Vec<Told>,
}

impl Source {
    /// The species to start from.
    pub(super) fn from(&self) -> Result<Species, CommandError> {
        files::species(&self.from)
    }

    /// What the clouds give when their organs are fitted with `rich`; `title` stands beside the bar.
    pub(super) fn class(&self, rich: &Species, title: &'static str) -> Result<Class, CommandError> {
        let bar = ProgressBar::new(self.clouds.len() as u64).with_prefix(title);
        bar.set_style(ProgressStyle::with_template("{prefix} {bar:40} {pos}/{len} {eta}").unwrap_or(bar.style()));
        let (mut lessons, mut told) = (Vec::new(), Vec::new());
        for path in &self.clouds {
            let cloud = path.display().to_string();
            let (lesson, refused) = match lesson(path, rich)? {
                Ok(lesson) => {
                    let refused = lesson.refused.iter().map(|r| format!("organ {}: {}", r.organ, r.reason)).collect();
                    (lesson, refused)
                }
                Err(reason) => (Lesson::default(), vec![reason]),
            };
            told.push(Told { cloud, leaves: lesson.leaves.len(), stems: lesson.stems.len(), refused });
            lessons.push(lesson);
            bar.inc(1);
        }
        bar.finish();
        Ok(Class { lessons, told })
    }

    /// What was learned from, for a species' provenance.
    pub(super) fn learned_from(&self, class: &Class) -> String {
        let credit = self.credit.as_deref().unwrap_or("no credit given");
        format!("{} of {} clouds ({credit})", class.organs(), self.clouds.len())
    }

    /// Writes the species and tells what it was learned from and how near its `curve` comes, which `lines` has in words.
    /// Partial when a cloud taught no blade.
    pub(super) fn write(
        &self,
        species: &Species,
        class: &Class,
        curve: &[impl Serialize],
        lines: &str,
        output: &Output,
    ) -> Result<Exit, CommandError> {
        files::write_species(&self.output, species)?;
        if output.json {
            output.json(&json!({
                "species": species.name, "output": self.output, "hash": species.hash(),
                "blades": class.blades(), "stems": class.stems(), "clouds": class.told, "curve": curve,
            }))?;
        } else {
            let table = table(&class.told);
            output.text(&format!("{table}{lines}{} -> {}\n", class.organs(), self.output.display()))?;
        }
        Ok(if class.lessons.iter().any(|l| l.leaves.is_empty()) { Exit::Partial } else { Exit::Done })
    }
}

impl Class {
    fn blades(&self) -> usize {
        self.lessons.iter().map(|l| l.leaves.len()).sum()
    }

    fn stems(&self) -> usize {
        self.lessons.iter().map(|l| l.stems.len()).sum()
    }

    fn organs(&self) -> String {
        format!("{} blades and {} stems", self.blades(), self.stems())
    }
}

/// What one cloud gave.
#[derive(Debug, Serialize)]
pub(super) struct Told {
    cloud: String,
    leaves: usize,
    stems: usize,
    /// One reason an organ that was refused, or one for the whole cloud.
    refused: Vec<String>,
}

/// A PLY file with `label`, or with `organ` and `kind`, is a plant in metres, z up; any other file is one leaf.
fn lesson(path: &Path, rich: &Species) -> Result<Result<Lesson, String>, CommandError> {
    let bytes = files::read(path)?;
    Ok(read(&bytes).and_then(|cloud| {
        if cloud.labels.is_none() && cloud.organs.is_none() {
            return Lesson::of_leaf(&cloud.points, DVec3::Z, rich).map_err(|error| chain(&error));
        }
        let up = Up::Axis(DVec3::Z);
        let organs = segment(&cloud, rich, Labels::Auto, up).map_err(|error| chain(&error))?.organs;
        Lesson::of_plant(organs, DVec3::Z, rich).map_err(|error| chain(&error))
    }))
}

/// Errors of the blades of a plant that is held out ([`blade_errors`]).
pub(super) fn plant_errors(path: &Path, species: &Species) -> Result<Vec<f64>, CommandError> {
    let up = Up::Axis(DVec3::Z);
    read(&files::read(path)?)
        .and_then(|cloud| segment(&cloud, species, Labels::Auto, up).map_err(|error| chain(&error)))
        .and_then(|found| blade_errors(&found.organs, DVec3::Z, species).map_err(|error| chain(&error)))
        .map_err(|reason| CommandError {
            exit: Exit::Failed,
            kind: "cloud",
            message: format!("{}: {reason}", path.display()),
            expected: None,
            found: None,
        })
}

fn read(bytes: &[u8]) -> Result<PointCloud, String> {
    if bytes.starts_with(b"ply") {
        return PointCloud::from_ply(bytes).map_err(|error| chain(&error));
    }
    let text = std::str::from_utf8(bytes).map_err(|_utf8| "expected PLY or text, found neither".to_owned())?;
    PointCloud::from_text(text).map_err(|error| chain(&error))
}

/// The table of what each cloud gave, with the refused organs below it.
fn table(told: &[Told]) -> String {
    let mut text = format!("{:>6} {:>6} {:>7}  cloud\n", "leaves", "stems", "refused");
    for t in told {
        text += &format!("{:>6} {:>6} {:>7}  {}\n", t.leaves, t.stems, t.refused.len(), t.cloud);
    }
    for t in told {
        for reason in &t.refused {
            text += &format!("refused: {}: {reason}\n", t.cloud);
        }
    }
    text
}
