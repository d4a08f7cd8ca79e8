//! Clouds that teach: what each gave, what was refused and why.

use std::path::{Path, PathBuf};

use demeter_recon::cloud::PointCloud;
use demeter_recon::learn::{Lesson, blade_errors};
use demeter_recon::model::Species;
use demeter_recon::segment::{Labels, Up, segment};
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::error::{CommandError, Exit, chain};
use crate::files;

/// What one cloud gave.
#[derive(Debug, Serialize)]
pub(super) struct Told {
    cloud: String,
    leaves: usize,
    stems: usize,
    /// One reason an organ that was refused, or one for the whole cloud.
    refused: Vec<String>,
}

/// Lessons of all clouds, in order, with what is told of them; a cloud that teaches nothing has an empty one.
pub(super) fn lessons(
    clouds: &[PathBuf],
    rich: &Species,
    title: &'static str,
) -> Result<(Vec<Lesson>, Vec<Told>), CommandError> {
    let bar = ProgressBar::new(clouds.len() as u64).with_prefix(title);
    bar.set_style(ProgressStyle::with_template("{prefix} {bar:40} {pos}/{len} {eta}").unwrap_or(bar.style()));
    let (mut lessons, mut told) = (Vec::new(), Vec::new());
    for path in clouds {
        let cloud = path.display().to_string();
        match lesson(path, rich)? {
            Ok(lesson) => {
                let refused = lesson.refused.iter().map(|r| format!("organ {}: {}", r.organ, r.reason)).collect();
                told.push(Told { cloud, leaves: lesson.leaves.len(), stems: lesson.stems.len(), refused });
                lessons.push(lesson);
            }
            Err(reason) => {
                told.push(Told { cloud, leaves: 0, stems: 0, refused: vec![reason] });
                lessons.push(Lesson::default());
            }
        }
        bar.inc(1);
    }
    bar.finish();
    Ok((lessons, told))
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
pub(super) fn table(told: &[Told]) -> String {
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
