//! maize-sideviews: leaves counted, outlines and lengths.

use std::collections::BTreeMap;
use std::path::Path;

use demeter_frame::Pose;
use demeter_recon::model::{Form, OrganKind, Species, forward, leaf};
use demeter_recon::view::patches;
use demeter_recon::view::strap::{Silhouette, Sketch, Stroke};
use glam::DVec2;
use image::GrayImage;

use super::outline::{iou, rendered, tinted};
use super::{Figure, Photo, Run};
use crate::commands::eval::leaf::processor_ms;
use crate::commands::eval::progress;
use crate::error::CommandError;
use crate::eye::Eye;
use crate::files;
use crate::picture::draw_over;
use crate::portrait::{Portrait, grass};

pub(super) const CROPS: &str = "maize-sideviews, crops";
pub(super) const CABINET: &str = "maize-sideviews, cabinet";
const CROPS_FOLDER: &str = "maize-sideviews/CountingByRegression_CNNs";
const CABINET_FOLDER: &str = "maize-sideviews/CountingByDetection_FasterRCNNs";
/// A fitted blade and a branch of the photo are one when their tips lie this near, in plant sizes.
const SAME_TIP: f64 = 0.05;

/// The whole plants on white: counts, outlines, lengths, time.
pub(super) fn crops(run: &Run<'_>, notes: &mut Vec<String>) -> Result<Vec<Figure>, CommandError> {
    let counts = counts(&run.data.join(CROPS_FOLDER), |fields| fields.last()?.parse().ok())?;
    let species = files::species("maize")?;
    let mut eye = Run::eye()?;
    let (mut all, mut ious, mut misses) = (Counted::default(), Vec::new(), Vec::new());
    let photos = run.photos(CROPS_FOLDER)?;
    let bar = progress(photos.len());
    for path in photos {
        bar.inc(1);
        let photo = Run::read(&mut eye, &path)?;
        let Some(portrait) = all.look(&mut eye, &photo, &species, &counts, notes) else {
            ious.push(0.0);
            continue;
        };
        let truth = plant_on_white(&photo);
        let drawn = rendered(&portrait.in_camera, &species, &photo.camera, Pose::IDENTITY)?;
        ious.push(iou(&above_rim(&truth, drawn), &truth.mask));
        misses.extend(length_misses(&truth.mask, &portrait, &species, &photo)?);
        let over = draw_over(&photo.rgb, &photo.camera, &portrait.in_camera, &species, Pose::IDENTITY)
            .map_err(|error| CommandError::failed("overlay", &error))?;
        run.draw("crops", &path, &[&photo.rgb, &tinted(&photo.rgb, &truth.mask), &over])?;
    }
    let mut figures = all.figures(CROPS);
    let figure = |name, values, goal| Figure { set: CROPS, name, values, goal };
    figures.push(figure("IoU of rendered plant", ious, ">= 0.60"));
    figures.push(figure("leaf length, MAPE", misses, "<= 0.15"));
    Ok(figures)
}

/// The plants in their cabinet: counts.
pub(super) fn cabinet(run: &Run<'_>, notes: &mut Vec<String>) -> Result<Vec<Figure>, CommandError> {
    let tips = |fields: &[&str]| {
        let labels = fields.iter().skip(1).filter(|field| matches!(field.trim(), "intact" | "cut")).count();
        (labels > 0).then_some(labels)
    };
    let counts = counts(&run.data.join(CABINET_FOLDER), tips)?;
    let species = files::species("maize")?;
    let mut eye = Run::eye()?;
    let mut all = Counted::default();
    for path in run.photos(CABINET_FOLDER)? {
        let photo = Run::read(&mut eye, &path)?;
        if let Some(portrait) = all.look(&mut eye, &photo, &species, &counts, notes) {
            let over = draw_over(&photo.rgb, &photo.camera, &portrait.in_camera, &species, Pose::IDENTITY)
                .map_err(|error| CommandError::failed("overlay", &error))?;
            run.draw("cabinet", &path, &[&photo.rgb, &over])?;
        }
    }
    Ok(all.figures(CABINET))
}

/// Leaves of each photo that a folder's CSV files tell, by its name; `count` reads a line's fields.
fn counts(folder: &Path, count: fn(&[&str]) -> Option<usize>) -> Result<BTreeMap<String, usize>, CommandError> {
    let mut counts = BTreeMap::new();
    for path in crate::commands::eval::files_of(folder, "csv")? {
        let bytes = files::read(&path)?;
        for line in String::from_utf8_lossy(&bytes).lines() {
            let fields: Vec<&str> = line.split([',', '\t', '"', '[', ']']).filter(|f| !f.trim().is_empty()).collect();
            let name = fields.iter().find(|field| field.ends_with(".jpg"));
            if let (Some(name), Some(count)) = (name, count(&fields)) {
                counts.insert((*name).to_owned(), count);
            }
        }
    }
    Ok(counts)
}

/// What was counted.
#[derive(Default)]
struct Counted {
    found: Vec<f64>,
    away: Vec<f64>,
    over: Vec<f64>,
    seconds: Vec<f64>,
}

impl Counted {
    /// Fits a photo's plant and counts its leaves.
    fn look(
        &mut self,
        eye: &mut Eye,
        photo: &Photo,
        species: &Species,
        counts: &BTreeMap<String, usize>,
        notes: &mut Vec<String>,
    ) -> Option<Portrait> {
        let started = processor_ms();
        let found = grass(eye, &photo.rgb, &photo.camera, species);
        self.seconds.push((processor_ms() - started) / 1e3);
        let portrait = found.unwrap_or_else(|error| {
            notes.push(format!("{}: {error}", photo.path.display()));
            None
        });
        self.found.push(f64::from(u8::from(portrait.is_some())));
        let leaves = portrait.as_ref().map_or(0, |portrait| {
            portrait.in_camera.organs.iter().filter(|organ| organ.kind() == OrganKind::Leaf).count()
        });
        let name = photo.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if let Some(&count) = counts.get(&name) {
            self.away.push(leaves.abs_diff(count) as f64);
            self.over.push(leaves as f64 - count as f64);
            if leaves.abs_diff(count) > 2 {
                notes.push(format!("{name}: {leaves} leaves, {count} counted"));
            }
        }
        portrait
    }

    fn figures(self, set: &'static str) -> Vec<Figure> {
        let figure = |name, values, goal| Figure { set, name, values, goal };
        vec![
            figure("plant found", self.found, ">= 0.95"),
            figure("leaf count, absolute error", self.away, "<= 1.5"),
            figure("leaf count, bias", self.over, ""),
            figure("seconds of one core", self.seconds, "<= 1"),
        ]
    }
}

/// A plant on white and the row of the pot's rim under it.
struct OnWhite {
    mask: GrayImage,
    rim: u32,
}

/// Blue is what plants swallow and white walls do not: the threshold is Otsu's, of blue, but never brighter than this.
const MOST_BLUE: u8 = 140;
/// Columns of the cabinet's frame at either side: dark in more than this share, in this outer share of the width.
const FRAME_DARK: f64 = 0.5;
const FRAME_WIDTH: f64 = 0.06;
/// A patch is a plant's when it is this green on average, 2 g - r - b, and has so many pixels.
const GREEN: f64 = 8.0;
const MIN_PATCH: usize = 30;
/// The rim is where a run of so many widths is not green, in this lowest share of the picture.
const RIM_RUN: f64 = 0.08;
const RIM_SHARE: f64 = 0.15;

/// The truth of a photo on white: a threshold, without the cabinet's frame, above the pot's rim.
fn plant_on_white(photo: &Photo) -> OnWhite {
    let rgb = &photo.rgb;
    let (width, height) = rgb.dimensions();
    let threshold = otsu(rgb.pixels().map(|p| p.0[2])).min(MOST_BLUE);
    let mut mask = GrayImage::from_fn(width, height, |x, y| {
        image::Luma([if rgb.get_pixel(x, y).0[2] <= threshold { 255 } else { 0 }])
    });
    let green = |x: u32, y: u32| {
        let [r, g, b] = rgb.get_pixel(x, y).0.map(f64::from);
        2.0 * g - r - b
    };
    for x in 0..width {
        let dark = (0..height).filter(|&y| mask.get_pixel(x, y).0[0] > 0).count() as f64;
        let aside = f64::from(x.min(width - 1 - x));
        if dark > FRAME_DARK * f64::from(height) && aside < FRAME_WIDTH * f64::from(width) {
            for x in x.saturating_sub(2)..(x + 3).min(width) {
                (0..height).for_each(|y| mask.put_pixel(x, y, image::Luma([0])));
            }
        }
    }
    let lowest = (f64::from(height) * (1.0 - RIM_SHARE)) as u32;
    let is_rim = |y: &u32| {
        let (mut run, mut longest) = (0, 0);
        for x in 0..width {
            run = if mask.get_pixel(x, *y).0[0] > 0 && green(x, *y) < GREEN { run + 1 } else { 0 };
            longest = longest.max(run);
        }
        f64::from(longest) > RIM_RUN * f64::from(width)
    };
    let rim = (lowest..height).find(is_rim).unwrap_or(height);
    for y in rim..height {
        (0..width).for_each(|x| mask.put_pixel(x, y, image::Luma([0])));
    }
    for patch in patches(&mask) {
        let sum: f64 = patch.pixels.iter().map(|&p| green(p as u32 % width, p as u32 / width)).sum();
        if patch.pixels.len() < MIN_PATCH || sum < GREEN * patch.pixels.len() as f64 {
            patch.pixels.iter().for_each(|&p| mask.as_mut()[p] = 0);
        }
    }
    OnWhite { mask, rim }
}

/// A mask without what lies at or under the rim.
fn above_rim(truth: &OnWhite, mut mask: GrayImage) -> GrayImage {
    for (_, y, pixel) in mask.enumerate_pixels_mut() {
        if y >= truth.rim {
            pixel.0[0] = 0;
        }
    }
    mask
}

/// The threshold that parts values into the two classes farthest apart (Otsu, "A Threshold Selection Method from
/// Gray-Level Histograms", 1979).
fn otsu(values: impl Iterator<Item = u8>) -> u8 {
    let mut counts = [0.0f64; 256];
    values.for_each(|v| counts[usize::from(v)] += 1.0);
    let all: f64 = counts.iter().sum();
    let total: f64 = counts.iter().enumerate().map(|(v, n)| v as f64 * n).sum();
    let (mut below, mut sum, mut best) = (0.0, 0.0, (f64::NEG_INFINITY, 0));
    for (v, n) in counts.iter().enumerate() {
        below += n;
        sum += v as f64 * n;
        if below > 0.0 && below < all {
            let apart = (sum / below - (total - sum) / (all - below)).powi(2) * below * (all - below);
            if apart > best.0 {
                best = (apart, v as u8);
            }
        }
    }
    best.1
}

/// Relative misses of fitted blades' lengths against the branches of the photo's skeleton that end at the same tips.
fn length_misses(
    truth: &GrayImage,
    portrait: &Portrait,
    species: &Species,
    photo: &Photo,
) -> Result<Vec<f64>, CommandError> {
    let Some(sketch) = Sketch::of(&Silhouette::of(truth)) else { return Ok(Vec::new()) };
    let posed = forward(&portrait.in_camera, species).map_err(|error| CommandError::failed("fit", &error))?;
    let focal = photo.camera.fx;
    // Length in pixels at the depth of its base, and where the tip is seen.
    let blades: Vec<(f64, DVec2)> = (portrait.in_camera.organs.iter().zip(&posed.control))
        .filter(|(organ, _)| matches!(organ.form, Form::Leaf { .. }))
        .filter_map(|(_, control)| {
            let vein: Vec<_> = (0..leaf::ROWS).map(|row| control[leaf::node(row, leaf::VEIN)]).collect();
            let metres: f64 = vein.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
            Some((metres * focal / vein[0].z, photo.camera.project(vein[leaf::ROWS - 1])?))
        })
        .collect();
    let (width, height) = photo.rgb.dimensions();
    let near = SAME_TIP * f64::from(width).hypot(f64::from(height));
    let length = |stroke: &Stroke| stroke.points.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f64>();
    let tip = |branch: &Stroke| branch.points[branch.points.len() - 1];
    let mut pairs: Vec<(f64, usize, usize)> = (sketch.blades.iter().enumerate())
        .flat_map(|(k, branch)| blades.iter().enumerate().map(move |(j, (_, at))| (at.distance(tip(branch)), k, j)))
        .filter(|(away, ..)| *away <= near)
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The nearest tips first: no blade is two branches.
    let (mut branches, mut taken) = (vec![false; sketch.blades.len()], vec![false; blades.len()]);
    let mut misses = Vec::new();
    for (_, k, j) in pairs {
        if !(branches[k] || taken[j]) {
            (branches[k], taken[j]) = (true, true);
            let branch = &sketch.blades[k];
            misses.push((blades[j].0 / smoothed_length(branch, length(branch)) - 1.0).abs());
        }
    }
    Ok(misses)
}

/// Length of a line of pixels without their steps: over every fifth pixel, never longer than the line.
fn smoothed_length(stroke: &Stroke, most: f64) -> f64 {
    let few: Vec<DVec2> = stroke.points.iter().copied().step_by(5).chain(stroke.points.last().copied()).collect();
    few.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f64>().min(most)
}
