//! Plants on white.

use std::path::Path;

use demeter_recon::statistics::quantile;

use super::{Goal, Ours, Row};
use crate::commands::eval::clouds::some;
use crate::commands::eval::{files_of, progress};
use crate::error::CommandError;
use crate::files;

/// What is darker than this part of the picture's light, in its darkest channel, is no wall. By eye.
const WALL: f64 = 0.72;
/// The lowest part of the picture that holds the pot's rim, and the side parts that hold edges of the chamber.
const POT: f64 = 0.06;
const EDGE: f64 = 0.02;

/// IoU of the plants with what is not white above the pot's rim.
pub(super) fn judge(network: &mut Ours, folder: &Path, every: usize) -> Result<Vec<Row>, CommandError> {
    let paths = some(files_of(folder, "jpg")?, every);
    let bar = progress(paths.len());
    let mut ious = Vec::new();
    for path in paths {
        bar.inc(1);
        let picture = files::photo(&path)?;
        let maps = network.run(&picture)?;
        let semantic = maps.semantic();
        let darkest = |p: &image::Rgb<u8>| f64::from(p.0[0].min(p.0[1]).min(p.0[2]));
        let light = quantile(picture.pixels().map(darkest), 0.9).unwrap_or(255.0);
        let (width, height) = picture.dimensions();
        let (mut both, mut either) = (0usize, 0usize);
        for (x, y, pixel) in picture.enumerate_pixels() {
            let (across, down) = (f64::from(x) / f64::from(width), f64::from(y) / f64::from(height));
            if down > 1.0 - POT || !(EDGE..=1.0 - EDGE).contains(&across) {
                continue;
            }
            let at = maps.at(x, y);
            let (dark, plant) = (darkest(pixel) < WALL * light, semantic.get_pixel(at.0, at.1).0[0] > 0);
            both += usize::from(dark && plant);
            either += usize::from(dark || plant);
        }
        ious.push(both as f64 / f64::max(1.0, either as f64));
    }
    let figure = "plants: IoU with what is not white";
    Ok(vec![Row { set: "side views".into(), figure, ours: ious, ramp: Vec::new(), goal: Goal::Nothing }])
}
