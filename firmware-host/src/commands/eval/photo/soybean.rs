//! The photo of the release's soybean 6_o.

use demeter_frame::Pose;
use demeter_recon::model::OrganKind;
use image::GrayImage;
use serde::Deserialize;

use super::outline::{iou, rendered, tinted};
use super::{Figure, Run};
use crate::commands::eval::leaf::processor_ms;
use crate::error::CommandError;
use crate::files;
use crate::picture::draw_over;
use crate::portrait::Portrait;

pub(super) const NAME: &str = "soybean 6_o";
const FOLDER: &str = "demeter-release/soybean/6_o";
/// The plant's outline, drawn by hand.
const OUTLINE: &str = include_str!("../../../../../tests/fixtures/outlines/soybean-6_o.json");
/// `class.txt` calls leaves 0.
const LEAF: &str = "0";

#[derive(Deserialize)]
struct Outline {
    polygons: Vec<Vec<[f64; 2]>>,
}

pub(super) fn figures(run: &Run<'_>, notes: &mut Vec<String>) -> Result<Vec<Figure>, CommandError> {
    let folder = run.data.join(FOLDER);
    let species = files::species("soybean")?;
    let mut eye = Run::eye()?;
    let photo = Run::read(&mut eye, &folder.join("photo.jpg"))?;
    let classes = files::read(&folder.join("info/class.txt"))?;
    let classes = String::from_utf8_lossy(&classes).into_owned();
    let blades = classes.lines().filter(|line| line.split_whitespace().nth(1) == Some(LEAF)).count();
    let outline: Outline = serde_json::from_str(OUTLINE).map_err(|error| CommandError::failed("outline", &error))?;
    let truth = outline.mask(photo.rgb.width(), photo.rgb.height());

    let started = processor_ms();
    let sight = eye.look(&photo.rgb, &photo.camera, None);
    let sight = sight.map_err(|error| CommandError::failed(error.name(), &error))?;
    let source = sight.scale_source;
    let portrait = sight.plants.into_iter().next().map(|plant| Portrait::of(plant, &species, &photo.camera, source));
    let seconds = (processor_ms() - started) / 1e3;
    let (mut found, mut agreement) = (0, 0.0);
    match portrait {
        Some(Ok(portrait)) => {
            found = portrait.in_camera.organs.iter().filter(|organ| organ.kind() == OrganKind::Leaf).count();
            agreement = iou(&rendered(&portrait.in_camera, &species, &photo.camera, Pose::IDENTITY)?, &truth);
            let over = draw_over(&photo.rgb, &photo.camera, &portrait.in_camera, &species, Pose::IDENTITY)
                .map_err(|error| CommandError::failed("overlay", &error))?;
            run.draw("soybean", &photo.path, &[&photo.rgb, &tinted(&photo.rgb, &truth), &over])?;
        }
        Some(Err(error)) => notes.push(format!("{NAME}: {error}")),
        None => notes.push(format!("{NAME}: no plant found")),
    }
    let figure = |name, value, goal| Figure { set: NAME, name, values: vec![value], goal };
    Ok(vec![
        figure("blades found less blades there are", found as f64 - blades as f64, "-1 to 1"),
        figure("IoU of rendered plant", agreement, ">= 0.50"),
        figure("seconds of one core", seconds, "<= 1"),
    ])
}

impl Outline {
    /// Pixels whose centres lie in a polygon.
    fn mask(&self, width: u32, height: u32) -> GrayImage {
        GrayImage::from_fn(width, height, |x, y| {
            let at = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            image::Luma([if self.polygons.iter().any(|polygon| inside(polygon, at)) { 255 } else { 0 }])
        })
    }
}

/// Whether a ray from a point crosses a polygon an odd number of times.
fn inside(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crosses = |([ax, ay], [bx, by]): &(&[f64; 2], &[f64; 2])| {
        (*ay > y) != (*by > y) && x < ax + (bx - ax) * (y - ay) / (by - ay)
    };
    sides.filter(crosses).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_hold_their_area() {
        let square = |x: f64| vec![[x, 2.0], [x + 4.0, 2.0], [x + 4.0, 6.0], [x, 6.0]];
        let area = |polygons| Outline { polygons }.mask(20, 10).pixels().filter(|p| p.0[0] > 0).count();
        assert_eq!(area(vec![square(1.0)]), 16);
        assert_eq!(area(vec![square(1.0), square(3.0)]), 24);
        assert_eq!(area(vec![vec![]]), 0);
    }
}
