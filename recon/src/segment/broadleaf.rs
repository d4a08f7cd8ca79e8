//! Broad-leaved plants without labels: flat neighbourhoods are leaves, elongated ones stems, unless a network says which
//! are which; leaves grow along agreeing normals, stems are taken apart along their skeleton.

use glam::DVec3;

use super::unlabelled::Evidence;
use super::{MIN_ORGAN_POINTS, blades, grain, nearest_to, organ, parting, stems};
use crate::axes::PrincipalAxes;
use crate::graph::pieces;
use crate::model::{OrganKind, Species};
use crate::nearest::{Nearest, Neighbour};
use crate::organs::OrganCloud;

/// Radius of the neighbourhoods that are judged, as a share of the bounding box diagonal: wider than stems are
/// thick, narrower than leaves are wide (a guess from soybean, tomato and tobacco).
const SCALE_SHARE: f64 = 0.025;
/// Second over first standard deviation of a neighbourhood below which it is a stem.
const STEM_FLATNESS: f64 = 0.42;
/// Third over second standard deviation of a neighbourhood above which it is a thicket of stems and not a blade.
const LEAF_THICKNESS: f64 = 0.45;
/// Cosine of the largest angle between neighbouring normals of one leaf (35°).
const SAME_LEAF_COSINE: f64 = 0.82;
/// The same above which stem points are heaped and no line.
const BALL_FLATNESS: f64 = 0.6;
/// Share of a heap's points that may lie beside lines (a guess).
const BALL_CONTACT: f64 = 0.3;
/// Nearest points that alone may show a sheet, or all within half the radius where they are more.
const FEW: usize = 15;
/// Farthest neighbour in a sheet, in grains: a sheet's 15th is at 1.2.
const SHEET_REACH: f64 = 1.6;
/// Largest piece of a stem that may pass for a sheet, as a share of the largest blade's points (a guess).
const PATCH_SHARE: f64 = 0.2;
/// Share of the cloud's points that is the least blade, of geometry's and of a network's (guesses: a network's classes
/// are flecked).
const LEAST: f64 = 1.0 / 400.0;
const LEAST_PREDICTED: f64 = 1.0 / 200.0;
/// Weight of a network's classes beside geometry's: what it is sure of stands, where it doubts geometry decides.
const TRUST: f64 = 2.0 / 3.0;
/// Neighbours whose votes smooth the classes.
pub(super) const VOTERS: usize = 15;

pub(super) fn segment(
    points: &[DVec3],
    foot: DVec3,
    up: DVec3,
    species: &Species,
    evidence: Option<&Evidence>,
) -> Vec<OrganCloud> {
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
    if let Some(evidence) = evidence {
        let share = |near: &[usize]| near.iter().filter(|j| !is_stem[**j]).count() as f64 / near.len() as f64;
        let leaf = |near: &[usize]| TRUST * evidence.leaf_among(near) + (1.0 - TRUST) * share(near);
        is_stem = near.iter().map(|near| leaf(near) < 0.5).collect();
    }
    let base = nearest_to(points, foot);
    // The foot is a stem whatever it looks like.
    for n in search.within(points[base], radius) {
        is_stem[n.index] = true;
    }
    let least = evidence.map_or(LEAST, |_| LEAST_PREDICTED) * points.len() as f64;
    let least = MIN_ORGAN_POINTS.max(least as usize);
    let balls = match evidence {
        // A network knows leaves that are no sheets, and stems that are.
        Some(_) => Vec::new(),
        None => balls(points, &near, &shapes, &is_stem, SHEET_REACH * grain),
    };
    let balls: Vec<Vec<usize>> = balls.into_iter().filter(|ball| ball.len() >= least).collect();
    let mut in_ball = vec![false; points.len()];
    for i in balls.iter().flatten() {
        (in_ball[*i], is_stem[*i]) = (true, false);
    }
    let joined = |i: usize| {
        let same = |j: &usize| {
            !is_stem[*j]
                && !in_ball[*j]
                && points[i].distance(points[*j]) < SHEET_REACH * grain
                && shapes[i].normal.dot(shapes[*j].normal).abs() > SAME_LEAF_COSINE
        };
        (!is_stem[i] && !in_ball[i]).then(|| near[i].iter().copied().filter(same).collect())
    };
    let sheets: Vec<Option<Vec<usize>>> = (0..points.len()).map(joined).collect();
    let normals: Vec<DVec3> = shapes.iter().map(|shape| shape.normal).collect();
    let (blades, edge) = blades::apart(points, &normals, &sheets, grain, evidence.map(|e| e.distance.as_slice()));
    // A piece of a thick stem's surface is a sheet too, but a small one, and its edge is not free.
    let largest = blades.iter().map(Vec::len).max().unwrap_or(0) as f64;
    let by_stem = |i: &usize| near[*i].iter().any(|j| is_stem[*j]);
    let is_blade = |blade: &Vec<usize>| {
        let free = blade.iter().filter(|i| edge[**i] && !by_stem(i)).count();
        evidence.is_some()
            || blade.len() as f64 > PATCH_SHARE * largest
            || free >= blade.iter().filter(|i| by_stem(i)).count()
    };
    let (blades, patches): (Vec<_>, Vec<_>) = blades.into_iter().partition(is_blade);
    patches.concat().into_iter().for_each(|i| is_stem[i] = true);
    let (mut blades, crumbs): (Vec<_>, Vec<_>) = blades.into_iter().partition(|c| c.len() >= least);
    blades.extend(balls);
    let stems: Vec<usize> = (0..points.len()).filter(|i| is_stem[*i]).collect();
    let (blades, stems) = adopt(points, blades, stems, crumbs.concat());
    let blades = parting::part(points, blades, up, species);
    let mut organs = stems::split(points, &stems, &blades, foot, species.habit, evidence.map(|e| e.main.as_slice()));
    organs.extend(blades.into_iter().map(|m| organ(points, OrganKind::Leaf, m)));
    organs
}

/// Leaves that are no sheets, crumpled or just unfolding: compact heaps of stem points that are no lines, at the end
/// of what they hang on.
fn balls(
    points: &[DVec3],
    near: &[Vec<usize>],
    shapes: &[Neighbourhood],
    is_stem: &[bool],
    reach: f64,
) -> Vec<Vec<usize>> {
    let heaped = |i: usize| is_stem[i] && shapes[i].flatness > BALL_FLATNESS;
    let joined = |i: usize| near[i].iter().copied().filter(move |j| points[i].distance(points[*j]) < reach);
    let mut found = pieces(points.len(), joined, heaped);
    found.retain(|piece| {
        let sd = PrincipalAxes::of(piece.iter().map(|i| points[*i])).deviation;
        let by_line = |i: &&usize| near[**i].iter().any(|j| is_stem[*j] && !heaped(*j));
        let lines = piece.iter().filter(by_line).count() as f64;
        sd[1] > STEM_FLATNESS * sd[0] && lines < BALL_CONTACT * piece.len() as f64
    });
    found
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
    let axes_of = |found: &[Neighbour]| PrincipalAxes::of(found.iter().map(|f| points[f.index]));
    let wide = axes_of(&found).deviation;
    // Where blades cross or touch, the nearest points alone are of one of them.
    let few = found.partition_point(|f| f.distance() < 0.5 * radius).max(FEW).min(found.len());
    let PrincipalAxes { axes, deviation: close, .. } = axes_of(&found[..few]);
    let thickness = |sd: [f64; 3]| sd[2] / sd[1].max(1e-12);
    Neighbourhood {
        flatness: wide[1] / wide[0].max(1e-12),
        thickness: thickness(wide).min(thickness(close)),
        normal: axes.z_axis,
    }
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
