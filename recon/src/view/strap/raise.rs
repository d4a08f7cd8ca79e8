//! Lines in the picture into space: each organ stays where the picture shows it, in the plane of its stem.

use std::f64::consts::PI;

use demeter_frame::Intrinsics;
use glam::{DVec2, DVec3};

use super::trace::{Sketch, Stroke};
use crate::fit::{NODES, Pictured};
use crate::model::leaf::ROWS;
use crate::statistics::quantile;

/// Stations along a blade and a stem: enough for the waves of a strap.
const STATIONS: usize = ROWS;
/// Points across at each.
const ACROSS: usize = 5;
/// Of half widths along a stem this quantile is the stem's, where no blade lies over it.
const STEM_QUANTILE: f64 = 0.4;
/// Half of the points over which lines are smoothed, as a share of their length: they follow pixels.
const SMOOTH: f64 = 0.02;
/// The same of their half widths: blades wave more often than their nodes can follow.
const SMOOTH_WIDTH: f64 = 0.06;
/// Standard deviation of a node's depth, in lengths of its blade. A looser one lets blades lean to one side, where pixels
/// do not see it: at 0.15 one silhouette foretold eleven others with an overlap of 0.296, at 0.04 with 0.386
/// (docs/training.md).
const OUT_OF_PLANE: f64 = 0.04;

/// A view of a plant from the side by a level camera.
#[derive(Clone, Copy, Debug)]
pub struct SideView {
    /// The camera.
    pub camera: Intrinsics,
    /// Depth of the plant's stem, metres.
    pub depth: f64,
}

/// A plant of a picture in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Raised {
    /// Points of its main stem in the camera's frame.
    pub stem: Vec<DVec3>,
    /// Where the picture shows its blades.
    pub blades: Vec<Pictured>,
}

impl Sketch {
    /// The sketch in space.
    #[must_use]
    pub fn raised(&self, view: &SideView) -> Raised {
        let stem = self.stem.stations();
        let radius = quantile(&stem.radii, STEM_QUANTILE).unwrap_or(1.0);
        let mut raised = Raised { stem: view.stem(&stem, radius), blades: Vec::new() };
        let pixel = view.depth / view.camera.fx;
        for blade in &self.blades {
            let ribs = view.ribs(&blade.without_stem(radius).stations());
            raised.blades.push(Pictured { nodes: points(&ribs), pixel, depth: OUT_OF_PLANE });
        }
        raised
    }
}

/// A blade's middle and the vector from there to its edge.
type Rib = (DVec3, DVec3);

/// The nodes of a blade of these ribs.
fn points(ribs: &[Rib]) -> Vec<DVec3> {
    let (step, across) = ((STATIONS - 1) / (NODES.rows() - 1), NODES.columns());
    let side = move |j: usize| 2.0 * j as f64 / (across - 1) as f64 - 1.0;
    ribs.iter().step_by(step).flat_map(|(middle, edge)| (0..across).map(move |j| *middle + *edge * side(j))).collect()
}

impl SideView {
    /// The half of the stem's tube that the camera sees.
    fn stem(&self, stem: &Stroke, radius: f64) -> Vec<DVec3> {
        let mut points = Vec::new();
        let metres = self.depth / self.camera.fx;
        for (k, at) in stem.points.iter().enumerate() {
            let across = stem.direction(k).perp();
            for j in 0..ACROSS {
                let angle = PI * (j as f64 + 0.5) / ACROSS as f64;
                let near = self.depth - radius * metres * angle.sin();
                points.push(self.camera.unproject(*at + across * (radius * angle.cos()), near));
            }
        }
        points
    }

    /// A blade's ribs, as wide as they are seen. It shows its upper face.
    fn ribs(&self, blade: &Stroke) -> Vec<Rib> {
        let course: Vec<DVec3> = blade.points.iter().map(|at| self.camera.unproject(*at, self.depth)).collect();
        let along: Vec<DVec3> = (0..course.len())
            .map(|k| (course[(k + 1).min(course.len() - 1)] - course[k.saturating_sub(1)]).normalize_or_zero())
            .collect();
        // The picture's y points down.
        let up = if along.iter().map(|along| along.x).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        let rib = |((at, along), radius): ((&DVec3, &DVec3), &f64)| {
            let seen = radius * self.depth / self.camera.fx;
            (*at, along.cross(DVec3::Z).normalize_or_zero() * (seen * up))
        };
        course.iter().zip(&along).zip(&blade.radii).map(rib).collect()
    }
}

impl Stroke {
    /// Without what lies over the stem, whose half width is `radius` pixels.
    fn without_stem(&self, radius: f64) -> Self {
        let Some(first) = self.points.first() else { return self.clone() };
        let from = self.points.iter().position(|p| p.distance(*first) > radius).unwrap_or(0);
        let from = from.min(self.points.len() / 3);
        Self { points: self.points[from..].to_vec(), radii: self.radii[from..].to_vec() }
    }

    /// Smoothed, at [`STATIONS`] places.
    fn stations(&self) -> Self {
        let last = self.points.len() - 1;
        let window = |k: usize, share: f64| {
            let middle = k * last / (STATIONS - 1);
            // As far to one side as to the other, so that ends stay.
            let reach = ((last as f64 * share) as usize).max(1).min(middle).min(last - middle);
            (middle - reach..=middle + reach, (2 * reach + 1) as f64)
        };
        let point = |k| {
            let (window, size) = window(k, SMOOTH);
            self.points[window].iter().sum::<DVec2>() / size
        };
        let radius = |k| {
            let (window, size) = window(k, SMOOTH_WIDTH);
            self.radii[window].iter().sum::<f64>() / size
        };
        Self { points: (0..STATIONS).map(point).collect(), radii: (0..STATIONS).map(radius).collect() }
    }

    fn direction(&self, k: usize) -> DVec2 {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(self.points.len() - 1));
        (self.points[after] - self.points[before]).normalize_or_zero()
    }
}
