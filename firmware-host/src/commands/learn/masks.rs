//! Pictures of leaves: masks, or scans whose transparency is the mask.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use demeter_recon::learn::{Ends, Outline, Traced};
use image::imageops::{FilterType, resize};
use image::{DynamicImage, GrayImage, ImageReader};
use indicatif::{ProgressBar, ProgressStyle};

use super::contours::Rejected;
use crate::error::{CommandError, chain};
use crate::files::{self, file_error};

/// Longest side of a mask, pixels: larger ones are shrunk. A pixel is then 0.05 % of a leaf's length, a tenth of the error
/// that ten components leave.
const LONGEST: u32 = 2048;
/// Endings of the files that are taken from a folder.
const PICTURES: [&str; 3] = ["png", "jpg", "jpeg"];

/// The traced pictures, what could not be traced with the reason, and the hash of all files.
pub(super) struct Scans {
    pub(super) names: Vec<String>,
    pub(super) traced: Vec<Traced>,
    pub(super) refused: Vec<Rejected>,
    pub(super) hash: String,
}

/// Traces every picture among `paths` and in the folders among them, in the order of their names.
pub(super) fn scans(paths: &[PathBuf], ends: Ends) -> Result<Scans, CommandError> {
    let pictures = pictures(paths)?;
    let bar = ProgressBar::new(pictures.len() as u64).with_prefix("outlines");
    bar.set_style(ProgressStyle::with_template("{prefix} {bar:40} {pos}/{len} {eta}").unwrap_or(bar.style()));
    let mut hash = blake3::Hasher::new();
    let mut scans = Scans { names: Vec::new(), traced: Vec::new(), refused: Vec::new(), hash: String::new() };
    for path in pictures {
        let bytes = files::read(&path)?;
        hash.update(blake3::hash(&bytes).as_bytes());
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let traced = mask(&bytes).and_then(|mask| Outline::trace(&mask, ends).map_err(|error| chain(&error)));
        match traced {
            Ok(traced) => {
                scans.names.push(name);
                scans.traced.push(traced);
            }
            Err(reason) => scans.refused.push(Rejected { file: name, reason }),
        }
        bar.inc(1);
    }
    bar.finish();
    scans.hash = hash.finalize().to_hex().to_string();
    Ok(scans)
}

fn pictures(paths: &[PathBuf]) -> Result<Vec<PathBuf>, CommandError> {
    let is_picture = |path: &Path| {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        PICTURES.contains(&ending.as_str())
    };
    let mut found = Vec::new();
    for path in paths {
        if path.is_dir() {
            let failed = |error: std::io::Error| file_error(path, &error);
            for entry in std::fs::read_dir(path).map_err(failed)? {
                let path = entry.map_err(failed)?.path();
                found.extend(is_picture(&path).then_some(path));
            }
        } else {
            found.push(path.clone());
        }
    }
    found.sort();
    Ok(found)
}

/// White where the leaf is: what is opaque where a picture has transparency, else what is bright.
fn mask(bytes: &[u8]) -> Result<GrayImage, String> {
    // The reader's own limits refuse pictures that would not fit in memory.
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|error| error.to_string())?;
    let picture = reader.decode().map_err(|error| chain(&error))?;
    Ok(shrunk(if picture.color().has_alpha() { alpha(&picture) } else { picture.into_luma8() }))
}

fn alpha(picture: &DynamicImage) -> GrayImage {
    let rgba = picture.to_rgba8();
    if rgba.pixels().all(|p| p.0[3] == u8::MAX) {
        return picture.to_luma8();
    }
    GrayImage::from_fn(rgba.width(), rgba.height(), |x, y| image::Luma([rgba.get_pixel(x, y).0[3]]))
}

fn shrunk(mask: GrayImage) -> GrayImage {
    let (width, height) = mask.dimensions();
    if width.max(height) <= LONGEST {
        return mask;
    }
    let side = |side: u32| (u64::from(side) * u64::from(LONGEST) / u64::from(width.max(height))).max(1) as u32;
    resize(&mask, side(width), side(height), FilterType::Triangle)
}
