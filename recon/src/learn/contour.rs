//! The outer contour of a region, below the pixel.

use glam::DVec2;

use super::mask::Region;

/// Taubin's smoothing factors: a step in and a step out. Together they keep whatever is longer than about 14 steps of
/// the contour (pass band 1/λ + 1/μ = 0.1) at its length and place, where plain averaging would shrink the leaf.
const LAMBDA: f64 = 0.5;
const MU: f64 = 1.0 / (0.1 - 1.0 / LAMBDA);
/// Pairs of steps; what is shorter than the pass band is down to a tenth or less.
const PASSES: usize = 20;

/// The contour of a region in pixels with y up, counter-clockwise: a point in the middle of each pixel edge that
/// separates inside from outside, then smoothed. Empty for an empty region.
pub(super) fn contour(region: &Region) -> Vec<DVec2> {
    let mut points = crack(region);
    points.reverse();
    for _ in 0..PASSES {
        relax(&mut points, LAMBDA);
        relax(&mut points, MU);
    }
    points
}

/// Follows the edges between pixels with the inside on the right, from the first pixel's upper left corner; middles of
/// the edges, y up. Pixels that touch at a corner only are apart.
fn crack(region: &Region) -> Vec<DVec2> {
    let Some(start) = region.first() else { return Vec::new() };
    let mut points = Vec::new();
    let ((mut x, mut y), (mut dx, mut dy)) = (start, (1i64, 0i64));
    loop {
        points.push(DVec2::new(x as f64 + dx as f64 / 2.0, -(y as f64 + dy as f64 / 2.0)));
        (x, y) = (x + dx, y + dy);
        // The two pixels beyond the corner that was reached.
        let right = region.has(x + (dx - dy - 1) / 2, y + (dx + dy - 1) / 2);
        let left = region.has(x + (dx + dy - 1) / 2, y + (dy - dx - 1) / 2);
        (dx, dy) = match (right, left) {
            (false, _) => (-dy, dx),
            (true, true) => (dy, -dx),
            (true, false) => (dx, dy),
        };
        if (x, y) == start && (dx, dy) == (1, 0) {
            return points;
        }
    }
}

/// Moves every point of a closed line by `factor` towards the middle of its neighbours.
fn relax(points: &mut [DVec2], factor: f64) {
    let n = points.len();
    let (Some(first), Some(mut before)) = (points.first().copied(), points.last().copied()) else { return };
    for i in 0..n {
        let after = if i + 1 < n { points[i + 1] } else { first };
        let here = points[i];
        points[i] = here + factor * ((before + after) / 2.0 - here);
        before = here;
    }
}

/// Signed area of a polygon, positive when counter-clockwise.
pub(super) fn area(polygon: &[DVec2]) -> f64 {
    edges(polygon).map(|(a, b)| a.perp_dot(b)).sum::<f64>() / 2.0
}

/// The edges of a closed polygon.
pub(super) fn edges(polygon: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + Clone {
    polygon.iter().copied().zip(polygon.iter().copied().cycle().skip(1))
}

/// True when no two edges of a closed polygon meet but neighbours at their common end.
pub(super) fn is_simple(polygon: &[DVec2]) -> bool {
    let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a);
    let n = polygon.len();
    let edges: Vec<(DVec2, DVec2)> = edges(polygon).collect();
    let apart = |(a, b): (DVec2, DVec2), (c, d): (DVec2, DVec2)| {
        a.max(b).cmplt(c.min(d)).any()
            || c.max(d).cmplt(a.min(b)).any()
            || side(a, b, c) * side(a, b, d) > 0.0
            || side(c, d, a) * side(c, d, b) > 0.0
    };
    n >= 3
        && edges.iter().all(|(a, b)| a != b)
        && (0..n).all(|i| (i + 2..n).all(|j| (i == 0 && j == n - 1) || apart(edges[i], edges[j])))
}

/// True when a polygon contains a point (even-odd rule).
pub(super) fn contains(polygon: &[DVec2], p: DVec2) -> bool {
    let crossed = edges(polygon).filter(|(a, b)| {
        (a.y > p.y) != (b.y > p.y) && {
            let x = a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x);
            x > p.x
        }
    });
    crossed.count() % 2 == 1
}

/// Distance from a point to a closed polygon's line.
pub(super) fn distance(polygon: &[DVec2], p: DVec2) -> f64 {
    let to_edge = |(a, b): (DVec2, DVec2)| {
        let along = b - a;
        let t = ((p - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        p.distance_squared(a + t * along)
    };
    edges(polygon).map(to_edge).fold(f64::INFINITY, f64::min).sqrt()
}
