//! A cloud beside what was made of it, each organ in its colour, for people to look at.

use std::io::Cursor;
use std::path::Path;

use demeter_recon::cloud::PointOrgan;
use demeter_recon::metrics::sample_surface;
use demeter_recon::model::OrganKind;
use glam::{DMat3, DVec3};
use image::{ImageFormat, Rgb, RgbImage};

use super::clouds::Fitted;
use crate::error::CommandError;
use crate::files;

/// Width and height of each of the two, pixels.
const SIDE: u32 = 700;
/// Empty border of each, pixels.
const MARGIN: f64 = 20.0;
/// Points that stand for the fitted surface.
const SAMPLES: usize = 120_000;
/// Colour of points that no organ was fitted to.
const NOBODYS: Rgb<u8> = Rgb([200, 200, 200]);
/// Colour of the main stem, or of all stems, where organs are beside their truth.
const MAIN_STEM: Rgb<u8> = Rgb([230, 0, 0]);

/// Writes `path` (.png): the points of the cloud by the organ they were given to, and the plant, seen level from the
/// side on which it spreads most.
///
/// # Errors
/// [`CommandError`] `picture` or `file` when it cannot be written.
pub(super) fn write(path: &Path, points: &[DVec3], fitted: &Fitted) -> Result<(), CommandError> {
    let mut colours = vec![NOBODYS; points.len()];
    for (organ, source) in fitted.source.iter().enumerate() {
        let members = source.map_or(&[][..], |k| &fitted.tree.organs[k].source);
        members.iter().for_each(|point| colours[*point as usize] = colour(organ));
    }
    let mesh = &fitted.described.mesh;
    let surface = sample_surface(mesh, SAMPLES, 0);
    let painted = surface.into_iter().map(|(point, face)| (point, colour(mesh.organ_of_face[face] as usize)));
    let up = fitted.described.plant.world_from_plant.rotation * DVec3::Z;
    pair(path, points, up, [points.iter().copied().zip(colours).collect(), painted.collect()])
}

/// Writes `path` (.png): the points of a cloud by their true organs, and by those that were found.
///
/// # Errors
/// As [`write`].
pub(super) fn divisions(
    path: &Path,
    points: &[DVec3],
    up: DVec3,
    organs: [&[PointOrgan]; 2],
) -> Result<(), CommandError> {
    let of = |point: &PointOrgan| match (usize::try_from(point.organ), point.kind) {
        (Err(_), _) => NOBODYS,
        (Ok(_), OrganKind::MainStem) => MAIN_STEM,
        (Ok(organ), _) => colour(organ),
    };
    pair(path, points, up, organs.map(|organs| points.iter().copied().zip(organs.iter().map(of)).collect()))
}

/// Two pictures of points side by side, framed alike.
fn pair(path: &Path, points: &[DVec3], up: DVec3, dots: [Vec<(DVec3, Rgb<u8>)>; 2]) -> Result<(), CommandError> {
    let panel = Panel::around(points, up);
    let mut picture = RgbImage::from_pixel(2 * SIDE, SIDE, Rgb([255; 3]));
    for (left, dots) in [0, SIDE].into_iter().zip(dots) {
        panel.draw(&mut picture, left, dots.into_iter());
    }
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png).map_err(|error| CommandError::failed("picture", &error))?;
    files::write(path, &bytes.into_inner())
}

/// A dark colour of an organ's own: steps of the golden ratio through the bits of a byte each.
fn colour(organ: usize) -> Rgb<u8> {
    let of = |step: f64| ((organ as f64 * step + 0.3).fract() * 210.0) as u8;
    Rgb([of(0.618), of(0.414), of(0.236)])
}

/// A level view: world to right, up and towards the eye.
struct Panel {
    view_from_world: DMat3,
    middle: DVec3,
    pixels_a_metre: f64,
}

impl Panel {
    fn around(points: &[DVec3], up: DVec3) -> Self {
        let (side, front) = up.any_orthonormal_pair();
        let spread = |right: DVec3| {
            let at = || points.iter().map(|p| p.dot(right));
            at().fold(f64::NEG_INFINITY, f64::max) - at().fold(f64::INFINITY, f64::min)
        };
        let turns = (0..12).map(|k| f64::from(k) * std::f64::consts::PI / 12.0);
        let rights = turns.map(|turn| side * turn.cos() + front * turn.sin());
        let right = rights.max_by(|a, b| spread(*a).total_cmp(&spread(*b))).unwrap_or(side);
        let view_from_world = DMat3::from_cols(right, up, right.cross(up)).transpose();
        let seen = || points.iter().map(|p| view_from_world * *p);
        let low = seen().fold(DVec3::INFINITY, DVec3::min);
        let high = seen().fold(DVec3::NEG_INFINITY, DVec3::max);
        let size = (high - low).truncate().max_element().max(f64::MIN_POSITIVE);
        let pixels_a_metre = (f64::from(SIDE) - 2.0 * MARGIN) / size;
        Self { view_from_world, middle: (low + high) / 2.0, pixels_a_metre }
    }

    /// Draws points as dots of two pixels, the nearest last.
    fn draw(&self, picture: &mut RgbImage, left: u32, points: impl Iterator<Item = (DVec3, Rgb<u8>)>) {
        let mut seen: Vec<(DVec3, Rgb<u8>)> =
            points.map(|(p, colour)| (self.view_from_world * p - self.middle, colour)).collect();
        seen.sort_by(|a, b| a.0.z.total_cmp(&b.0.z));
        let half = f64::from(SIDE) / 2.0;
        for (p, colour) in seen {
            let (x, y) = (half + p.x * self.pixels_a_metre, half - p.y * self.pixels_a_metre);
            for (x, y) in [(x, y), (x + 1.0, y), (x, y + 1.0), (x + 1.0, y + 1.0)] {
                if (0.0..f64::from(SIDE)).contains(&x) && (0.0..f64::from(SIDE)).contains(&y) {
                    picture.put_pixel(left + x as u32, y as u32, colour);
                }
            }
        }
    }
}
