//! Where a plant stands, in any pose: of all its ends the one from which it radiates.

use glam::DVec3;

use super::lattice::one_a_cell;
use crate::axes::PrincipalAxes;
use crate::graph::CloudGraph;

/// Points that the search looks at: enough for a leaf to be a sheet and a stalk a tube.
const SEEN: usize = 2_000;
/// Ends that are looked at; a plant of more leaves has its foot among the farthest of them all the same, because a
/// stalk's end is far from every tip (a guess).
const ENDS: usize = 20;
/// Share of the plant's reach that is an end's own piece, looked at in [`SLICES`].
const PIECE_SHARE: f64 = 0.2;
const SLICES: usize = 8;

/// The foot of a plant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    /// A point of the cloud.
    pub(super) point: DVec3,
    /// Unit direction in which the stalk leaves it.
    pub(super) direction: DVec3,
}

/// Finds the foot. The end of a stalk is round where a leaf's tip is a sheet; its
/// cross-sections move along; and paths from it run straight to every other point, where paths from a tip turn back at
/// the fork. Each is a number from 0 to 1, and an end's score is their sum, straightness twice because all of the plant
/// has a say in it, and depth four times when the vertical is known. Where stems are known the foot is an end of theirs,
/// and the lowest one of an upright plant.
pub(super) fn find(points: &[DVec3], is_stem: Option<&[bool]>, up: Option<DVec3>) -> Foot {
    let seen = one_a_cell(points, SEEN);
    let is_stem: Option<Vec<bool>> = is_stem.map(|of| seen.iter().map(|i| of[*i]).collect());
    let seen: Vec<DVec3> = seen.into_iter().map(|i| points[i]).collect();
    let may_be = |i: usize| is_stem.as_ref().is_none_or(|of| of[i]);
    let lowest = |up: DVec3| {
        let candidates = (0..seen.len()).filter(|i| may_be(*i));
        candidates.min_by(|a, b| seen[*a].dot(up).total_cmp(&seen[*b].dot(up))).unwrap_or(0)
    };
    if let (Some(up), true) = (up, is_stem.is_some()) {
        return Foot { point: seen[lowest(up)], direction: up };
    }
    let graph = CloudGraph::new(&seen);
    let heights = up.map(|up| {
        let heights: Vec<f64> = seen.iter().map(|p| p.dot(up)).collect();
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        heights.into_iter().map(|h| (h - low) / (high - low).max(1e-12)).collect::<Vec<f64>>()
    });
    let mut best = (f64::NEG_INFINITY, Foot { point: points[0], direction: up.unwrap_or(DVec3::Z) });
    let mut nearest = graph.distances(&[0]);
    for n in 0..ENDS {
        // The lowest point is a candidate too: among many leaves a short stalk is no far end.
        let end = match up {
            Some(up) if n == 0 => lowest(up),
            _ => farthest(&nearest, may_be),
        };
        let distance = graph.distances(&[end]);
        for (near, d) in nearest.iter_mut().zip(&distance) {
            // The start of the search was no end.
            *near = if n == 0 { *d } else { near.min(*d) };
        }
        let piece = Piece::of(&seen, &distance, end);
        let stem = is_stem.as_ref().map_or(0.0, |of| share(&distance, piece.reach, |i| of[i]));
        let depth = heights.as_ref().map_or(0.0, |h| -4.0 * h[end]);
        let score = piece.roundness + 2.0 * piece.straightness + piece.progress + stem + depth;
        if score > best.0 {
            best = (score, Foot { point: seen[end], direction: piece.direction });
        }
    }
    best.1
}

fn farthest(distance: &[f64], may_be: impl Fn(usize) -> bool) -> usize {
    (0..distance.len()).filter(|i| may_be(*i)).max_by(|a, b| distance[*a].total_cmp(&distance[*b])).unwrap_or(0)
}

/// The share of an end's piece that is so.
fn share(distance: &[f64], reach: f64, so: impl Fn(usize) -> bool) -> f64 {
    let piece: Vec<usize> = (0..distance.len()).filter(|i| distance[*i] < 0.5 * PIECE_SHARE * reach).collect();
    piece.iter().filter(|i| so(**i)).count() as f64 / piece.len().max(1) as f64
}

/// What an end looks like.
struct Piece {
    /// Distance to the farthest point, metres.
    reach: f64,
    /// Shorter over longer standard deviation of its cross-sections.
    roundness: f64,
    /// How far its cross-sections move along, over what they would on a straight piece: nothing within a stalk, where
    /// they move both ways.
    progress: f64,
    /// Distance through the air over distance along the plant, its mean over the plant.
    straightness: f64,
    /// Unit direction in which it leaves.
    direction: DVec3,
}

impl Piece {
    fn of(points: &[DVec3], distance: &[f64], end: usize) -> Self {
        let reach = distance.iter().copied().fold(0.0, f64::max).max(1e-12);
        let step = PIECE_SHARE * reach / SLICES as f64;
        let mut slices = vec![Vec::new(); SLICES + 1];
        let (mut straight, mut beyond) = (0.0, 0);
        for (p, d) in points.iter().zip(distance) {
            if let Some(slice) = slices.get_mut((d / step) as usize) {
                slice.push(*p);
            } else {
                straight += p.distance(points[end]) / d;
                beyond += 1;
            }
        }
        let centre = |slice: &[DVec3]| slice.iter().copied().sum::<DVec3>() / slice.len().max(1) as f64;
        let filled: Vec<&Vec<DVec3>> = slices.iter().filter(|slice| !slice.is_empty()).collect();
        let centres: Vec<DVec3> = filled.iter().map(|slice| centre(slice)).collect();
        let (mut roundness, mut sections) = (0.0, 0);
        // The first slice is a cap and no cross-section.
        for k in 1..filled.len().saturating_sub(1) {
            let axis = (centres[k + 1] - centres[k - 1]).normalize_or_zero();
            let section = filled[k].iter().map(|p| (*p - centres[k]).reject_from_normalized(axis));
            let [long, short, _] = PrincipalAxes::of(section).deviation;
            roundness += short / long.max(1e-12);
            sections += 1;
        }
        let sections = f64::from(sections.max(1));
        let along = centres[centres.len() - 1] - centres[0];
        let course: f64 = centres.windows(2).map(|w| w[0].distance(w[1])).sum();
        Self {
            reach,
            roundness: roundness / sections,
            progress: along.length() / course.max(step * SLICES as f64),
            straightness: straight / f64::from(beyond.max(1)),
            direction: (along.normalize_or_zero() + (centre(points) - points[end]).normalize_or_zero())
                .normalize_or(DVec3::Z),
        }
    }
}
