//! Blades that touch taken apart. A blade is a sheet that is deep in its middle, depth being the distance to its edge
//! along it; where two touch, the way from one middle to the other leads through a shallow neck.

use std::f64::consts::PI;

use glam::DVec3;

use crate::graph::shortest;

/// Largest angle without neighbours around a point within a sheet; at an edge it is about π, and 15 neighbours at
/// random leave this much free on one point in fifty.
const EDGE_GAP: f64 = 0.75 * PI;
/// A neck at least this deep, as a share of the shallower middle, is none (a guess: ovals that overlap by a tenth of
/// their length meet at about 0.6).
const NECK: f64 = 0.7;
/// Differences of depth below this many grains are the scan's raggedness.
const RAGGED: f64 = 0.4;

/// Divides the points of sheets; returns blades, and which points are at an edge. `near` lists each point's neighbours
/// in its own sheet, `None` for points of no sheet; `normals` are unit, `grain` is metres. Where the distance of each point
/// to the nearest of `others`, organs that are not its own, is known, metres too, depth is the geometric mean of both: what
/// parts blades is a neck that has others beside it.
pub(super) fn apart(
    points: &[DVec3],
    normals: &[DVec3],
    near: &[Option<Vec<usize>>],
    grain: f64,
    others: Option<&[f64]>,
) -> (Vec<Vec<usize>>, Vec<bool>) {
    let inside: Vec<usize> = (0..points.len()).filter(|i| near[*i].is_some()).collect();
    let around = |i: usize| near[i].iter().flatten().copied();
    let may_be: Vec<bool> = (0..points.len())
        .map(|i| near[i].is_some() && free_angle(points, i, normals[i], around(i)) > EDGE_GAP)
        .collect();
    // An edge is a line: a lone point of one is chance.
    let edge: Vec<usize> =
        inside.iter().copied().filter(|i| may_be[*i] && around(*i).filter(|j| may_be[*j]).count() != 1).collect();
    let metres = |i: usize, j: usize| points[i].distance(points[j]);
    let raw = shortest(points.len(), &edge, |i| around(i).map(move |j| (j, metres(i, j))));
    // A closed sheet has no edge.
    let raw = |i: usize| if raw[i].is_finite() { raw[i] } else { grain };
    let smooth = |i: usize, of: &dyn Fn(usize) -> f64| {
        (of(i) + around(i).map(of).sum::<f64>()) / (1.0 + around(i).count() as f64)
    };
    let other = |i: usize| others.map_or_else(|| raw(i), |others| others[i]);
    let depth: Vec<f64> = (0..points.len()).map(|i| (smooth(i, &raw) * smooth(i, &other)).sqrt()).collect();
    let mut order = inside;
    order.sort_by(|a, b| depth[*b].total_cmp(&depth[*a]));
    let mut basins = Basins { of: vec![usize::MAX; points.len()], parent: Vec::new(), peak: Vec::new() };
    for i in order {
        let mut meeting: Vec<(usize, usize)> =
            around(i).filter(|j| basins.of[*j] != usize::MAX).map(|j| (basins.root(basins.of[j]), j)).collect();
        let Some((deepest, _)) = meeting.iter().copied().max_by(|a, b| depth[a.1].total_cmp(&depth[b.1])) else {
            basins.of[i] = basins.parent.len();
            basins.parent.push(basins.parent.len());
            basins.peak.push(depth[i]);
            continue;
        };
        basins.of[i] = deepest;
        meeting.sort_unstable();
        meeting.dedup_by_key(|(basin, _)| *basin);
        for (other, _) in meeting {
            let (a, b) = (basins.root(deepest), basins.root(other));
            let peak = basins.peak[a].min(basins.peak[b]);
            if a != b && (depth[i] >= NECK * peak || peak - depth[i] < RAGGED * grain) {
                basins.join(a, b);
            }
        }
    }
    let mut blades = vec![Vec::new(); basins.parent.len()];
    for i in (0..points.len()).filter(|i| basins.of[*i] != usize::MAX) {
        blades[basins.root(basins.of[i])].push(i);
    }
    blades.retain(|blade| !blade.is_empty());
    (blades, may_be)
}

/// The largest angle around a point, in its tangent plane, without a neighbour.
fn free_angle(points: &[DVec3], i: usize, normal: DVec3, near: impl Iterator<Item = usize>) -> f64 {
    let (x, y) = normal.any_orthonormal_pair();
    let offsets = near.filter(|j| *j != i).map(|j| points[j] - points[i]);
    let mut angles: Vec<f64> = offsets.map(|d| d.dot(y).atan2(d.dot(x))).collect();
    angles.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else { return 2.0 * PI };
    angles.windows(2).map(|w| w[1] - w[0]).fold(2.0 * PI - (last - first), f64::max)
}

/// Basins around middles, joined where no neck parts them.
struct Basins {
    /// Basin of each point, `usize::MAX` before it is reached.
    of: Vec<usize>,
    parent: Vec<usize>,
    /// Depth of each basin's middle, metres.
    peak: Vec<f64>,
}

impl Basins {
    fn root(&self, mut basin: usize) -> usize {
        while self.parent[basin] != basin {
            basin = self.parent[basin];
        }
        basin
    }

    /// The shallower goes to the deeper.
    fn join(&mut self, a: usize, b: usize) {
        let (keep, gone) = if self.peak[a] >= self.peak[b] { (a, b) } else { (b, a) };
        self.parent[gone] = keep;
    }
}
