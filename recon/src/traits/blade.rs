//! Traits of one blade.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::{Traits, Unit, keys, put};
use crate::model::PlantMesh;
use crate::model::leaf::{COLUMNS, ROWS, VEIN, node};
use crate::polyline::path_length;

/// Rows of the main vein whose chord is the direction in which a blade leaves its stem: a quarter.
const FIRST_QUARTER: usize = (ROWS - 1) / 4;

/// Area in square metres and area-weighted normal (its length the area of a flat blade) of each organ's faces.
pub(super) fn areas(mesh: &PlantMesh, organs: usize) -> Vec<(f64, DVec3)> {
    let mut areas = vec![(0.0, DVec3::ZERO); organs];
    for (face, organ) in mesh.organ_of_face.iter().enumerate() {
        let [a, b, c] = mesh.corners(face);
        let normal = (b - a).cross(c - a) / 2.0;
        let (area, sum) = &mut areas[*organ as usize];
        *area += normal.length();
        *sum += normal;
    }
    areas
}

/// Measures a blade from its control points in the world, its area and normal, and the direction of the stem that
/// carries it where it hangs.
pub(super) fn measure(traits: &mut Traits, control: &[DVec3], (area, normal): (f64, DVec3), stem: DVec3) {
    let vein: Vec<DVec3> = (0..ROWS).map(|i| control[node(i, VEIN)]).collect();
    let along = path_length(vein.iter().copied());
    let rows = (1..ROWS - 1).map(|i| path_length(control[node(i, 0)..node(i, COLUMNS)].iter().copied()));
    put(traits, keys::LEAF_AREA, area, Unit::SquareMetre);
    put(traits, keys::LEAF_LENGTH, along, Unit::Metre);
    put(traits, keys::LEAF_WIDTH, rows.fold(0.0, f64::max), Unit::Metre);
    let tilt = normal.angle_between(DVec3::Z);
    if tilt.is_finite() {
        let whichever_side = FRAC_PI_2 - (tilt - FRAC_PI_2).abs();
        put(traits, keys::LEAF_INCLINATION, whichever_side, Unit::Radian);
    }
    let chord = vein[ROWS - 1] - vein[0];
    // Below a thousandth of its length a chord's horizontal part is rounding of the record.
    if chord.truncate().length() > 1e-3 * chord.length() {
        put(traits, keys::LEAF_AZIMUTH, chord.y.atan2(chord.x), Unit::Radian);
    }
    let leaving = (vein[FIRST_QUARTER] - vein[0]).angle_between(stem);
    if leaving.is_finite() {
        put(traits, keys::LEAF_INSERTION_ANGLE, leaving, Unit::Radian);
    }
    let turns = vein.windows(3).map(|p| (p[1] - p[0]).angle_between(p[2] - p[1])).filter(|angle| angle.is_finite());
    if along > 0.0 {
        put(traits, keys::LEAF_CURVATURE, turns.sum::<f64>() / along, Unit::PerMetre);
    }
}
