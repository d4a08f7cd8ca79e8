//! field-rows: plants on row lines.

use std::path::Path;

use demeter_capture::decode_photo;
use demeter_recon::view::patches;
use image::GrayImage;

use super::outline::tinted;
use super::{Figure, Photo, Run};
use crate::commands::eval::{leaf::processor_ms, progress};
use crate::error::CommandError;
use crate::files;

pub(super) const NAME: &str = "field-rows";
const FOLDER: &str = "field-rows";
/// A plant is on a line within this share of the picture's width.
const ON_LINE: f64 = 0.05;
/// Pixels this green, 2 g - r - b, are vegetation; patches of at least this share of the picture are blobs.
const GREEN: f64 = 40.0;
const MIN_BLOB: f64 = 0.0005;

pub(super) fn figures(run: &Run<'_>, notes: &mut Vec<String>) -> Result<Vec<Figure>, CommandError> {
    let mut eye = Run::eye()?;
    let (mut on_line, mut recall, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
    let photos = run.photos(&format!("{FOLDER}/image"))?;
    let bar = progress(photos.len());
    for path in photos {
        bar.inc(1);
        let photo = Run::read(&mut eye, &path)?;
        let label = run.data.join(FOLDER).join("label").join(path.file_name().unwrap_or_default());
        let lines = lines(&label)?;
        let started = processor_ms();
        let sight = eye.look(&photo.rgb, &photo.camera, None);
        seconds.push((processor_ms() - started) / 1e3);
        let boxes: Vec<[u32; 4]> = match sight {
            Ok(sight) => sight.plants.iter().map(|plant| plant.bounds).collect(),
            Err(error) => {
                notes.push(format!("{}: {error}", path.display()));
                Vec::new()
            }
        };
        let middle = |[x0, y0, x1, y1]: [u32; 4]| [f64::from(x0 + x1) / 2.0, f64::from(y0 + y1) / 2.0];
        let near = |at: [f64; 2]| lines.is_near(at, photo.rgb.width(), photo.rgb.height());
        on_line.extend(boxes.iter().map(|plant| f64::from(u8::from(near(middle(*plant))))));
        let (green, blobs) = blobs(&photo);
        for blob in blobs.into_iter().filter(|blob| near(middle(*blob))) {
            let [x, y] = middle(blob);
            let holds = |[x0, y0, x1, y1]: &[u32; 4]| {
                (f64::from(*x0)..=f64::from(*x1)).contains(&x) && (f64::from(*y0)..=f64::from(*y1)).contains(&y)
            };
            recall.push(f64::from(u8::from(boxes.iter().any(holds))));
        }
        let mut shown = tinted(&photo.rgb, &green);
        for [x0, y0, x1, y1] in boxes {
            let (right, bottom) = (x1.min(shown.width()) - 1, y1.min(shown.height()) - 1);
            (x0..=right)
                .for_each(|x| [y0, bottom].into_iter().for_each(|y| shown.put_pixel(x, y, image::Rgb([255, 0, 0]))));
            (y0..=bottom)
                .for_each(|y| [x0, right].into_iter().for_each(|x| shown.put_pixel(x, y, image::Rgb([255, 0, 0]))));
        }
        run.draw("field", &path, &[&photo.rgb, &shown])?;
    }
    let figure = |name, values, goal| Figure { set: NAME, name, values, goal };
    Ok(vec![
        figure("plants on a row line", on_line, ">= 0.80"),
        figure("blobs on a line found", recall, ">= 0.90"),
        figure("seconds of one core, seen only", seconds, ""),
    ])
}

/// Pixels of the labelled lines, in shares of the picture.
struct Lines(Vec<[f64; 2]>);

fn lines(path: &Path) -> Result<Lines, CommandError> {
    let label =
        decode_photo(&files::read(path)?).map_err(|error| CommandError::failed("bad_image", &error).of(path))?;
    let (width, height) = (f64::from(label.width()), f64::from(label.height()));
    let marked = label.enumerate_pixels().filter(|(_, _, p)| p.0[0] > 127);
    Ok(Lines(marked.map(|(x, y, _)| [(f64::from(x) + 0.5) / width, (f64::from(y) + 0.5) / height]).collect()))
}

impl Lines {
    fn is_near(&self, [x, y]: [f64; 2], width: u32, height: u32) -> bool {
        let (width, height) = (f64::from(width), f64::from(height));
        self.0.iter().any(|line| (line[0] * width - x).hypot(line[1] * height - y) <= ON_LINE * width)
    }
}

/// Vegetation and the boxes of its blobs.
fn blobs(photo: &Photo) -> (GrayImage, Vec<[u32; 4]>) {
    let green = GrayImage::from_fn(photo.rgb.width(), photo.rgb.height(), |x, y| {
        let [r, g, b] = photo.rgb.get_pixel(x, y).0.map(f64::from);
        image::Luma([if 2.0 * g - r - b > GREEN { 255 } else { 0 }])
    });
    let least = MIN_BLOB * green.len() as f64;
    let boxes =
        patches(&green).into_iter().filter(|patch| patch.pixels.len() as f64 >= least).map(|patch| patch.bounds);
    let boxes = boxes.collect();
    (green, boxes)
}
