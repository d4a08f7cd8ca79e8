//! A fitted plant drawn over the photo it was fitted to.

use demeter_frame::{Intrinsics, Pose, Rgb};
use glam::Vec3;

use crate::model::{OrganKind, Plant, PlantMesh};
use crate::world::raster::{Buffer, NONE};

/// Share of the plant's colour where it covers the photo: enough of the photo shines through to judge the fit.
const COVER: f32 = 0.7;
/// Light on a face seen edge-on; one seen from the front has 1.
const EDGE_LIGHT: f32 = 0.45;

/// Draws a plant's mesh, given in its own frame or the world's, over a copy of the photo: the main stem red, stems
/// orange, each blade in a colour of its own, lit from the camera.
///
/// The photo has the camera's size; a photo of another size comes back as it is.
#[must_use]
pub fn overlay(photo: &Rgb, camera: &Intrinsics, camera_from_mesh: Pose, mesh: &PlantMesh, plant: &Plant) -> Rgb {
    let mut drawn = photo.clone();
    if photo.dimensions() != (camera.width, camera.height) {
        return drawn;
    }
    let mut buffer = Buffer::new(camera.width as usize, camera.height as usize, 0.0);
    let lens = [camera.fx, camera.fy, camera.cx, camera.cy].map(|x| x as f32);
    let in_camera: Vec<Vec3> = mesh.positions.iter().map(|p| camera_from_mesh.point(*p).as_vec3()).collect();
    for (face, corners) in mesh.faces.iter().enumerate() {
        buffer.fill_perspective(corners.map(|v| in_camera[v as usize]), lens, face as u32);
    }
    for (pixel, &face) in drawn.pixels_mut().zip(&buffer.face) {
        if face == NONE {
            continue;
        }
        let [a, b, c] = mesh.faces[face as usize].map(|v| in_camera[v as usize]);
        let facing = (b - a).cross(c - a).normalize_or_zero().dot(a.normalize_or_zero()).abs();
        let organ = mesh.organ_of_face[face as usize] as usize;
        let colour = colour(organ, plant) * (EDGE_LIGHT + (1.0 - EDGE_LIGHT) * facing) * 255.0;
        for (channel, c) in pixel.0.iter_mut().zip(colour.to_array()) {
            *channel = (f32::from(*channel) * (1.0 - COVER) + c * COVER) as u8;
        }
    }
    drawn
}

fn colour(organ: usize, plant: &Plant) -> Vec3 {
    match plant.organs.get(organ).map(crate::model::plant::Organ::kind) {
        None | Some(OrganKind::MainStem) => Vec3::new(1.0, 0.15, 0.1),
        Some(OrganKind::Stem) => Vec3::new(1.0, 0.6, 0.1),
        Some(OrganKind::Leaf) => {
            // Steps of the golden angle keep neighbours apart; greens to violets, away from the stems' reds.
            let hue = 0.25 + 0.6 * (organ as f32 * 0.618_034).fract();
            let wave = |shift: f32| 0.5 + 0.5 * (std::f32::consts::TAU * (hue + shift)).cos();
            Vec3::new(wave(0.0), wave(-1.0 / 3.0), wave(1.0 / 3.0))
        }
    }
}
