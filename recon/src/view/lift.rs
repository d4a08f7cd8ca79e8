//! Organ instances of a picture into space.

use demeter_frame::{Instances, Pose};
use glam::{DVec2, DVec3};

use super::{DepthScale, Region, View};
use crate::axes::PrincipalAxes;
use crate::model::OrganKind;
use crate::organs::OrganCloud;

/// A surface seen steeper than this (tangent of the angle between its normal and the ray) is taken for a depth edge:
/// 84 degrees, where a pixel's depth says little. Ours; the paper only says "gradient".
pub(super) const MAX_SLOPE: f64 = 10.0;
/// When an instance would lose more than this share of its pixels at depth edges, the network's depth is blurred over
/// more than the organ's width and edges are everywhere: a plane through its log depth takes its place (a guess).
const MAX_EDGES: f64 = 0.5;
/// Weight of a flat organ (all at one depth) in that plane, as a share of the pixels: blur makes steep planes of noise.
const FLATNESS: f64 = 0.05;
/// Fewest points of a stem and of a leaf at 640 x 480 (paper supp. "2D Reconstruction").
const MIN_STEM: f64 = 30.0;
const MIN_LEAF: f64 = 100.0;
/// A leaf is a sheet: its oriented box is not as thick as this share of its length, nor so narrow that it is a line.
/// The paper gives no numbers; arched and rolled maize blades stay well inside these.
const MAX_LEAF_THICKNESS: f64 = 0.6;
const MIN_LEAF_WIDTH: f64 = 0.02;

/// One organ in space.
#[derive(Clone, Debug, PartialEq)]
pub struct LiftedOrgan {
    /// Kind and points; `source` holds pixel numbers, row major.
    pub cloud: OrganCloud,
    /// Its region in the picture.
    pub region: Region,
}

/// Why an instance was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DropReason {
    /// Too few points with depth away from depth edges.
    FewPoints,
    /// A leaf as thick as long.
    Thick,
    /// A leaf as narrow as a line.
    Narrow,
}

/// An instance left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Dropped {
    /// Its id in the raster.
    pub instance: u16,
    /// Why.
    pub reason: DropReason,
    /// What was counted or measured (points, or a share of the length).
    pub found: f64,
}

/// What came of a picture's instances.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lifted {
    /// Those that made it, in the order of their ids.
    pub organs: Vec<LiftedOrgan>,
    /// Those that did not.
    pub dropped: Vec<Dropped>,
}

/// Unprojects every instance: into the world when the camera's place is known, else into the camera's frame; metres
/// when `scale` is metric.
#[must_use]
pub fn lift(view: &View<'_>, raster: &Instances, regions: &[Region], scale: DepthScale) -> Lifted {
    let mut pixels: Vec<Vec<u32>> = vec![Vec::new(); regions.len()];
    for (p, &id) in raster.as_raw().iter().enumerate() {
        if let Some(pixels) = usize::from(id).checked_sub(1).and_then(|i| pixels.get_mut(i)) {
            pixels.push(p as u32);
        }
    }
    let target_from_camera = view.world_from_camera.unwrap_or(Pose::IDENTITY);
    let width = view.intrinsics.width;
    let unproject = |&(p, log_depth): &(u32, f64)| {
        let at = DVec2::new(f64::from(p % width) + 0.5, f64::from(p / width) + 0.5);
        let z = scale.depth(log_depth)?;
        Some((target_from_camera.point(view.intrinsics.unproject(at, z)), p))
    };
    let clouds = pixels.iter().map(|pixels| {
        depths(view, raster.as_raw(), pixels).iter().filter_map(unproject).unzip::<_, _, Vec<DVec3>, Vec<u32>>()
    });
    let mut lifted = Lifted::default();
    for (region, (points, source)) in regions.iter().zip(clouds) {
        let least = view.pixels(if region.kind == OrganKind::Leaf { MIN_LEAF } else { MIN_STEM });
        let fault = if points.len() < least.max(3) {
            Some((DropReason::FewPoints, points.len() as f64))
        } else if region.kind == OrganKind::Leaf {
            implausible(&points)
        } else {
            None
        };
        match fault {
            Some((reason, found)) => lifted.dropped.push(Dropped { instance: region.id, reason, found }),
            None => {
                let cloud = OrganCloud { kind: region.kind, points, source };
                lifted.organs.push(LiftedOrgan { cloud, region: region.clone() });
            }
        }
    }
    lifted
}

/// Pixels of an instance with their log depth: those away from depth edges, or, where edges are everywhere, all of them
/// on a plane.
fn depths(view: &View<'_>, raster: &[u16], pixels: &[u32]) -> Vec<(u32, f64)> {
    let log_depth = view.log_depth.as_raw();
    let seen: Vec<(u32, f64)> =
        pixels.iter().map(|&p| (p, f64::from(log_depth[p as usize]))).filter(|(_, d)| d.is_finite()).collect();
    let clear: Vec<(u32, f64)> = seen.iter().copied().filter(|&(p, _)| !steep(view, raster, p as usize)).collect();
    if (clear.len() as f64) >= (1.0 - MAX_EDGES) * seen.len() as f64 {
        return clear;
    }
    plane(&seen, view.intrinsics.width)
}

/// Log depths replaced by their least-squares plane over the picture.
fn plane(seen: &[(u32, f64)], width: u32) -> Vec<(u32, f64)> {
    let at = |p: u32| DVec2::new(f64::from(p % width), f64::from(p / width));
    let count = seen.len().max(1) as f64;
    let centre = seen.iter().map(|&(p, _)| at(p)).sum::<DVec2>() / count;
    let mean = seen.iter().map(|&(_, d)| d).sum::<f64>() / count;
    let (mut spread, mut slope) = (glam::DMat2::ZERO, DVec2::ZERO);
    for &(p, d) in seen {
        let x = at(p) - centre;
        spread += glam::DMat2::from_cols(x * x.x, x * x.y);
        slope += x * (d - mean);
    }
    // The prior acts on both directions as much as on the longer one: across a thin organ there is only blur.
    let prior = FLATNESS * (spread.x_axis.x + spread.y_axis.y).max(1.0);
    let slope = (spread + glam::DMat2::from_diagonal(DVec2::splat(prior))).inverse() * slope;
    seen.iter().map(|&(p, _)| (p, mean + slope.dot(at(p) - centre))).collect()
}

/// Whether depth changes too fast towards a neighbour of the same instance. Across instances it may jump: that is one
/// organ before another, and both are where they seem.
fn steep(view: &View<'_>, raster: &[u16], p: usize) -> bool {
    let (width, log_depth) = (view.intrinsics.width as usize, view.log_depth.as_raw());
    // One pixel is 1/f of the depth wide, so a surface of slope s changes the logarithm of depth by s/f.
    let limit = |f: f64| (MAX_SLOPE / f) as f32;
    let jump = |q: usize| (log_depth[q] - log_depth[p]).abs();
    let jumps = |q: usize, f: f64| raster[q] == raster[p] && (jump(q).is_nan() || jump(q) > limit(f));
    let (x, fx, fy) = (p % width, view.intrinsics.fx, view.intrinsics.fy);
    (x > 0 && jumps(p - 1, fx))
        || (x + 1 < width && jumps(p + 1, fx))
        || (p >= width && jumps(p - width, fy))
        || (p + width < raster.len() && jumps(p + width, fy))
}

/// What is wrong with the proportions of a leaf's oriented box.
fn implausible(points: &[DVec3]) -> Option<(DropReason, f64)> {
    let [length, width, thickness] = box_sides(points);
    if thickness > MAX_LEAF_THICKNESS * length {
        Some((DropReason::Thick, thickness / length))
    } else if width < MIN_LEAF_WIDTH * length {
        Some((DropReason::Narrow, width / length))
    } else {
        None
    }
}

/// Sides of the box along the principal axes that holds all but 2 % of the points at either end, longest first.
fn box_sides(points: &[DVec3]) -> [f64; 3] {
    let PrincipalAxes { centre, axes, .. } = PrincipalAxes::of(points.iter().copied());
    let mut sides = [0, 1, 2].map(|k| {
        let mut along: Vec<f64> = points.iter().map(|p| (*p - centre).dot(axes.col(k))).collect();
        along.sort_by(f64::total_cmp);
        along[(along.len() - 1) * 98 / 100] - along[(along.len() - 1) * 2 / 100]
    });
    sides.sort_by(|a, b| b.total_cmp(a));
    sides
}
