//! `demeter eval photo`: one picture to the right plant, on real photos (spec/reconstruction.md "Metrics", issue 4).

mod field;
mod maize;
mod outline;
mod silhouettes;
mod soybean;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use demeter_capture::decode_photo;
use demeter_frame::{Intrinsics, Rgb};
use demeter_recon::statistics::{mean, quantile};
use image::imageops::{FilterType, replace, resize};

use super::table::{Cell, Table};
use crate::config::ModelsConfig;
use crate::error::CommandError;
use crate::eye::Eye;
use crate::{files, lens, picture};

/// Arguments of `demeter eval photo`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Folder with the data sets, named as in the shared data, which it is by default.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Take every N-th photo of a set.
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Only the sets whose names hold this.
    #[arg(long, default_value = "")]
    only: String,
    /// Draw each photo beside the plants fitted to it into this folder. Pictures of the shared data stay out of the
    /// project.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
}

/// A figure of a set: one value a photo, and what it should come to.
struct Figure {
    set: &'static str,
    name: &'static str,
    values: Vec<f64>,
    goal: &'static str,
}

pub(super) fn table(args: &Args) -> Result<Table, CommandError> {
    let columns = ["set", "figure", "photos", "mean", "q10", "q90", "goal"];
    let mut table = Table::new("photo", &columns);
    let data = super::folder(args.data.as_ref(), "", "--data")?;
    let run = Run { args, data };
    type Set = fn(&Run<'_>, &mut Vec<String>) -> Result<Vec<Figure>, CommandError>;
    let sets: [(&str, Set); 5] = [
        (maize::CROPS, maize::crops),
        (maize::CABINET, maize::cabinet),
        (silhouettes::NAME, silhouettes::figures),
        (soybean::NAME, soybean::figures),
        (field::NAME, field::figures),
    ];
    for (_, figures) in sets.iter().filter(|(name, _)| name.contains(&args.only)) {
        for figure in figures(&run, &mut table.notes)? {
            table.rows.push(figure.row());
        }
    }
    Ok(table)
}

impl Figure {
    fn row(self) -> Vec<Cell> {
        let quantile = |share| quantile(&self.values, share);
        vec![
            self.set.into(),
            self.name.into(),
            Cell::Count(self.values.len()),
            Cell::figure(mean(&self.values), 3),
            Cell::figure(quantile(0.1), 3),
            Cell::figure(quantile(0.9), 3),
            self.goal.into(),
        ]
    }
}

/// What every set needs.
struct Run<'a> {
    args: &'a Args,
    data: PathBuf,
}

/// A photo with the camera that `demeter photo` takes it to be of.
struct Photo {
    path: PathBuf,
    rgb: Rgb,
    camera: Intrinsics,
}

impl Run<'_> {
    /// Every N-th photo of a folder of the data.
    fn photos(&self, folder: &str) -> Result<Vec<PathBuf>, CommandError> {
        let folder = super::folder(Some(&self.data.join(folder)), "", "--data")?;
        Ok(super::clouds::some(super::files_of(&folder, "jpg")?, self.args.every))
    }

    fn eye() -> Result<Eye, CommandError> {
        Ok(Eye::of_photos(&ModelsConfig::default(), NonZeroUsize::MIN)?)
    }

    /// A photo as `demeter photo` reads it.
    fn read(eye: &mut Eye, path: &Path) -> Result<Photo, CommandError> {
        let bytes = files::read(path)?;
        let photo = decode_photo(&bytes).map_err(|error| CommandError::failed("bad_image", &error).of(path))?;
        let (rgb, told) = lens::of(photo, &bytes, None, None)?;
        let camera = match told {
            Some(lens) => lens.camera,
            None => {
                let maps = eye.maps(&rgb).map_err(|error| CommandError::failed(error.name(), &error).of(path))?;
                lens::guessed(&rgb, &maps.camera).camera
            }
        };
        Ok(Photo { path: path.into(), rgb, camera })
    }

    /// Draws pictures side by side, each as high as the first, when pictures are asked for.
    fn draw(&self, set: &str, name: &Path, pictures: &[&Rgb]) -> Result<(), CommandError> {
        let (Some(folder), Some(first)) = (&self.args.pictures, pictures.first()) else { return Ok(()) };
        let height = first.height();
        let widths: Vec<u32> = pictures.iter().map(|p| p.width() * height / p.height().max(1)).collect();
        let mut sheet = Rgb::new(widths.iter().sum(), height);
        let mut left = 0;
        for (picture, width) in pictures.iter().zip(&widths) {
            replace(&mut sheet, &resize(*picture, *width, height, FilterType::Triangle), left, 0);
            left += i64::from(*width);
        }
        let stem = name.file_stem().map(|stem| stem.to_string_lossy().replace(' ', "_")).unwrap_or_default();
        let bytes = picture::png(&sheet).map_err(|error| CommandError::failed("picture", &error))?;
        files::write(&folder.join(format!("{set}-{stem}.png")), &bytes)
    }
}
