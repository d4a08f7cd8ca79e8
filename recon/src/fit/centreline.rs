//! A first guess of an organ's course: centres along its geodesic distance, and the joint angles that follow them.

use glam::{DQuat, DVec3};

use crate::graph::CloudGraph;

/// Points on a path at equal arc lengths.
pub(super) fn resample(path: &[DVec3], count: usize) -> Vec<DVec3> {
    let mut at = vec![0.0];
    for pair in path.windows(2) {
        at.push(at[at.len() - 1] + pair[0].distance(pair[1]));
    }
    let total = at[at.len() - 1];
    let mut segment = 0;
    (0..count)
        .map(|i| {
            let target = total * i as f64 / (count - 1) as f64;
            while segment + 2 < path.len() && at[segment + 1] < target {
                segment += 1;
            }
            let Some(next) = path.get(segment + 1) else { return path[0] };
            let span = at[segment + 1] - at[segment];
            let t = if span > 0.0 { ((target - at[segment]) / span).clamp(0.0, 1.0) } else { 0.0 };
            path[segment].lerp(*next, t)
        })
        .collect()
}

/// The course of an elongated cloud from `start` (its point where it hangs on its parent): means of `bins` slices of
/// equal geodesic distance, ending at the far end. At least two points come back for any cloud of at least one.
pub(super) fn course(points: &[DVec3], start: DVec3, bins: usize) -> Vec<DVec3> {
    let graph = CloudGraph::new(points);
    let near = (0..points.len())
        .min_by(|a, b| points[*a].distance_squared(start).total_cmp(&points[*b].distance_squared(start)));
    let Some(near) = near else { return vec![start, start] };
    let distance = graph.distances(&[near]);
    let far = distance.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max);
    let mut sums = vec![(DVec3::ZERO, 0usize); bins];
    for (p, d) in points.iter().zip(&distance) {
        let bin = ((d / far.max(f64::MIN_POSITIVE) * bins as f64) as usize).min(bins - 1);
        sums[bin].0 += *p;
        sums[bin].1 += 1;
    }
    // The farthest few points are the tip; their mean resists a single stray.
    let tips: Vec<DVec3> = points.iter().zip(&distance).filter(|(_, d)| **d >= 0.985 * far).map(|(p, _)| *p).collect();
    let tip = tips.iter().copied().sum::<DVec3>() / tips.len().max(1) as f64;
    let mut path = vec![start];
    path.extend(sums.iter().filter(|(_, n)| *n > 0).map(|(sum, n)| *sum / *n as f64));
    path.push(tip);
    smooth(&mut path);
    path
}

/// One pass of (1, 2, 1)/4, ends kept.
fn smooth(path: &mut [DVec3]) {
    let raw = path.to_vec();
    for i in 1..raw.len().saturating_sub(1) {
        path[i] = (raw[i - 1] + raw[i] * 2.0 + raw[i + 1]) / 4.0;
    }
}

/// Rotation vectors (a, 0, b) of a chain whose rest bones lie along +y, starting in frame `first`, so that its bones
/// take the directions of `path`'s segments: inverse kinematics without twist, exact.
pub(super) fn angles_along(path: &[DVec3], first: DQuat) -> Vec<f64> {
    let mut frame = first;
    let mut angles = Vec::with_capacity(2 * (path.len() - 1));
    for pair in path.windows(2) {
        let direction = frame.inverse() * (pair[1] - pair[0]).normalize_or(frame * DVec3::Y);
        let axis = DVec3::Y.cross(direction);
        let angle = axis.length().atan2(direction.y);
        let w = axis.normalize_or(DVec3::X) * angle;
        angles.extend([w.x, w.z]);
        frame *= DQuat::from_scaled_axis(w);
    }
    angles
}
