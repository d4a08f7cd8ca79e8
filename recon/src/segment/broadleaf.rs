//! Broad-leaved plants without labels: flat neighbourhoods are leaves, elongated ones stems; leaves grow along
//! agreeing normals, stems are taken apart along their skeleton.

use glam::DVec3;

use super::{MIN_ORGAN_POINTS, grain, nearest_to, organ, stems};
use crate::axes::PrincipalAxes;
use crate::graph::{CloudGraph, Skeleton, pieces, prune};
use crate::model::{Habit, OrganKind};
use crate::nearest::Nearest;
use crate::organs::OrganCloud;

/// Radius of the neighbourhoods that are judged, as a share of the bounding box diagonal: wider than stems are
/// thick, narrower than leaves are wide (a guess from soybean, tomato and tobacco).
const SCALE_SHARE: f64 = 0.025;
/// Second over first standard deviation of a neighbourhood below which it is a stem.
const STEM_FLATNESS: f64 = 0.42;
/// Third over second standard deviation of a neighbourhood above which it is a thicket of stems and not a blade.
const LEAF_THICKNESS: f64 = 0.45;
/// A path within a cluster of blades that is at least this share of its longest is a blade of its own.
const LEAFLET_SHARE: f64 = 0.4;
/// Cosine of the largest angle between neighbouring normals of one leaf (35°).
const SAME_LEAF_COSINE: f64 = 0.82;
/// Neighbours whose votes smooth the classes.
const VOTERS: usize = 15;

pub(super) fn segment(points: &[DVec3], foot: DVec3, habit: Habit) -> Vec<OrganCloud> {
    let search = Nearest::of(points);
    let grain = grain(points, &search, 10);
    let radius = (SCALE_SHARE * crate::cloud::diagonal(points).unwrap_or(0.0)).max(2.0 * grain);
    let shapes: Vec<Neighbourhood> = points.iter().map(|p| neighbourhood(points, &search, *p, radius)).collect();
    let mut is_stem: Vec<bool> =
        shapes.iter().map(|n| n.flatness < STEM_FLATNESS || n.thickness > LEAF_THICKNESS).collect();
    let near: Vec<Vec<usize>> =
        points.iter().map(|p| search.k(*p, VOTERS).into_iter().map(|n| n.index).collect()).collect();
    for _ in 0..2 {
        is_stem = near.iter().map(|n| 2 * n.iter().filter(|j| is_stem[**j]).count() > n.len()).collect();
    }
    let base = nearest_to(points, foot);
    // The foot is a stem whatever it looks like.
    for n in search.within(points[base], radius) {
        is_stem[n.index] = true;
    }
    let shapes = &shapes;
    let joined = |i: usize| {
        near[i].iter().copied().filter(move |j| {
            points[i].distance(points[*j]) < 2.5 * grain
                && shapes[i].normal.dot(shapes[*j].normal).abs() > SAME_LEAF_COSINE
        })
    };
    let clusters = pieces(points.len(), joined, |i| !is_stem[i]);
    let least = MIN_ORGAN_POINTS.max(points.len() / 400);
    let (leaves, crumbs): (Vec<_>, Vec<_>) = clusters.into_iter().partition(|c| c.len() >= least);
    let stems: Vec<usize> = (0..points.len()).filter(|i| is_stem[*i]).collect();
    let (leaves, stems) = adopt(points, leaves, stems, crumbs.concat());
    let stem_points: Vec<DVec3> = stems.iter().map(|i| points[*i]).collect();
    let stem_search = Nearest::of(&stem_points);
    let blades: Vec<Vec<usize>> =
        leaves.into_iter().flat_map(|cluster| split_blades(points, cluster, &stem_search, grain)).collect();
    let mut organs = stems::split(points, &stems, &blades, foot, habit);
    organs.extend(blades.into_iter().map(|m| organ(points, OrganKind::Leaf, m)));
    organs
}

/// The shape of a cloud around a point.
struct Neighbourhood {
    /// Second over first standard deviation: 0 a line, 1 a disc.
    flatness: f64,
    /// Third over second: 0 a sheet, 1 a thicket.
    thickness: f64,
    /// Unit normal of the best plane, either way.
    normal: DVec3,
}

fn neighbourhood(points: &[DVec3], search: &Nearest, p: DVec3, radius: f64) -> Neighbourhood {
    let mut found = search.within(p, radius);
    if found.len() < 8 {
        found = search.k(p, 8);
    }
    let PrincipalAxes { axes, deviation: sd, .. } = PrincipalAxes::of(found.iter().map(|f| points[f.index]));
    Neighbourhood { flatness: sd[1] / sd[0].max(1e-12), thickness: sd[2] / sd[1].max(1e-12), normal: axes.z_axis }
}

/// Takes apart blades that touch at their bases: seen along the cluster from where it meets its stem, each is a path
/// of its own.
fn split_blades(points: &[DVec3], members: Vec<usize>, stems: &Nearest, grain: f64) -> Vec<Vec<usize>> {
    let own: Vec<DVec3> = members.iter().map(|i| points[*i]).collect();
    let from_stem = |i: usize| stems.one(own[i]).map_or(f64::INFINITY, |n| n.distance_squared);
    let base = (0..own.len()).fold(0, |best, i| if from_stem(i) < from_stem(best) { i } else { best });
    let graph = CloudGraph::new(&own);
    let reach = graph.distances(&[base]).into_iter().fold(0.0, f64::max);
    let branches = Skeleton::of(&own, &graph, base, 1.5 * grain).branches(|_, length| length);
    let blades = prune(branches, &own, LEAFLET_SHARE * reach);
    blades.into_iter().map(|b| b.members.into_iter().map(|i| members[i]).collect()).collect()
}

/// Gives each crumb's points to the nearest leaf or stem.
fn adopt(
    points: &[DVec3],
    mut leaves: Vec<Vec<usize>>,
    mut stems: Vec<usize>,
    crumbs: Vec<usize>,
) -> (Vec<Vec<usize>>, Vec<usize>) {
    let owners: Vec<(usize, usize)> = leaves
        .iter()
        .enumerate()
        .flat_map(|(k, m)| m.iter().map(move |i| (*i, k)))
        .chain(stems.iter().map(|i| (*i, usize::MAX)))
        .collect();
    let search = Nearest::of(&owners.iter().map(|(i, _)| points[*i]).collect::<Vec<_>>());
    for i in crumbs {
        match search.one(points[i]).map(|n| owners[n.index].1) {
            Some(k) if k < leaves.len() => leaves[k].push(i),
            _ => stems.push(i),
        }
    }
    (leaves, stems)
}
