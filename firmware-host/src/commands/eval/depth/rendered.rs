//! Rendered pictures, where everything is known: folders of `demeter synth images`.

use std::path::Path;

use demeter_frame::{Rgb, Semantic, Tilt};
use serde::Deserialize;

use super::camera::Cameras;
use super::relative::{Pair, abs_rel};
use super::{Goal, Ours, Row};
use crate::commands::eval::progress;
use crate::error::CommandError;
use crate::files;

/// Issue 4: stem pixels found to be the main stem's or others' as they are.
const RIGHT_STEMS: f64 = 0.9;
/// ln of the last depth code less ln of the first, over the codes between: see `demeter synth images`.
const LOG_DEPTH_A_CODE: f64 = 6.907_755_278_982_137 / 65_534.0;
/// Pixels of an organ's kind below which a share says nothing.
const MIN_PIXELS: usize = 50;

/// The sizes in meta.json.
#[derive(Deserialize)]
struct Meta {
    count: usize,
    height: u32,
    width: u32,
}

/// A set of pictures in memory.
struct Set {
    meta: Meta,
    rgb: Vec<u8>,
    sem: Vec<u8>,
    depth: Vec<u8>,
    camera: Vec<u8>,
}

impl Set {
    fn read(folder: &Path) -> Result<Self, CommandError> {
        let bad = |name: &str, message: String| CommandError::usage("data", message).of(&folder.join(name));
        let meta = files::read(&folder.join("meta.json"))?;
        let meta: Meta = serde_json::from_slice(&meta).map_err(|error| bad("meta.json", error.to_string()))?;
        let pixels = meta.count.saturating_mul(meta.height as usize).saturating_mul(meta.width as usize);
        let file = |name: &str, bytes: usize| {
            let found = files::read(&folder.join(name))?;
            let fits = found.len() == bytes;
            fits.then_some(found).ok_or_else(|| bad(name, format!("expected {bytes} bytes as meta.json says")))
        };
        Ok(Self {
            rgb: file("rgb.u8", pixels.saturating_mul(3))?,
            sem: file("sem.u8", pixels)?,
            depth: file("depth.u16", pixels.saturating_mul(2))?,
            camera: file("camera.f32", meta.count.saturating_mul(12))?,
            meta,
        })
    }

    /// The i-th picture, if the files are as long as they were.
    fn picture(&self, i: usize) -> Option<Rgb> {
        let bytes = 3 * (self.meta.height * self.meta.width) as usize;
        Rgb::from_raw(self.meta.width, self.meta.height, self.rgb.get(i * bytes..(i + 1) * bytes)?.to_vec())
    }

    /// Field of view, pitch and roll.
    fn camera(&self, i: usize) -> [f64; 3] {
        [0, 4, 8].map(|at| {
            let bytes = &self.camera[12 * i + at..12 * i + at + 4];
            f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
        })
    }

    /// Inverse depth of pixel k of all, up to a factor.
    fn inverse_depth(&self, k: usize) -> Option<f64> {
        let code = u16::from_le_bytes([self.depth[2 * k], self.depth[2 * k + 1]]);
        (code > 0).then(|| (-LOG_DEPTH_A_CODE * f64::from(code)).exp())
    }
}

/// Camera, depth on plants, plants and stems.
pub(super) fn judge(network: &mut Ours, folder: &Path, every: usize) -> Result<Vec<Row>, CommandError> {
    let set = Set::read(folder)?;
    let row = |figure, goal| {
        let name = folder.file_name().unwrap_or(folder.as_os_str());
        Row { set: name.to_string_lossy().into(), figure, ours: Vec::new(), ramp: Vec::new(), goal }
    };
    let mut cameras = Cameras::new(&row("", Goal::Nothing).set);
    let mut depth = row("AbsRel on plants", Goal::Nothing);
    let mut plants = row("plants: IoU", Goal::Nothing);
    let mut seen = row("stems found to be stems", Goal::Nothing);
    let mut right = row("main stem or other right", Goal::AtLeast(RIGHT_STEMS));
    let is_stem = |class: u8| class == Semantic::Stem as u8 || class == Semantic::MainStem as u8;
    let bar = progress(set.meta.count.div_ceil(every.max(1)));
    for i in (0..set.meta.count).step_by(every.max(1)) {
        bar.inc(1);
        let Some(picture) = set.picture(i) else { continue };
        let maps = network.run(&picture)?;
        let [hfov, pitch, roll] = set.camera(i);
        cameras.add(&maps.camera, hfov, Tilt { pitch, roll });
        let semantic = maps.semantic();
        let (mut pairs, mut ramp): (Vec<Pair>, Vec<Pair>) = (Vec::new(), Vec::new());
        let [mut both, mut either, mut stems, mut stems_seen, mut stems_right] = [0usize; 5];
        let first = i * (set.meta.height * set.meta.width) as usize;
        for (k, (x, y, _)) in picture.enumerate_pixels().enumerate() {
            let (truth, at) = (set.sem[first + k], maps.at(x, y));
            let found = semantic.get_pixel(at.0, at.1).0[0];
            both += usize::from(truth > 0 && found > 0);
            either += usize::from(truth > 0 || found > 0);
            if is_stem(truth) {
                stems += 1;
                stems_seen += usize::from(is_stem(found));
                stems_right += usize::from(found == truth);
            }
            if let Some(inverse) = set.inverse_depth(first + k).filter(|_| truth > 0) {
                pairs.push(((-f64::from(maps.log_depth.get_pixel(at.0, at.1).0[0])).exp(), inverse));
                ramp.push((f64::from(y), inverse));
            }
        }
        if pairs.len() >= MIN_PIXELS {
            depth.ours.extend(abs_rel(&pairs));
            depth.ramp.extend(abs_rel(&ramp));
            plants.ours.push(both as f64 / either as f64);
        }
        if stems >= MIN_PIXELS {
            seen.ours.push(stems_seen as f64 / stems as f64);
        }
        if stems_seen >= MIN_PIXELS {
            right.ours.push(stems_right as f64 / stems_seen as f64);
        }
    }
    Ok(cameras.rows().into_iter().chain([depth, plants, seen, right]).collect())
}
