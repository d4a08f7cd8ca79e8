//! Corners that form a grid: from one to the next along the edges of the squares.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use glam::DVec2;

/// How far from where it should be the next corner may lie, as a share of a step: squares do not shrink faster from one to
/// the next, and what lies farther is another corner (a guess).
const ASTRAY: f64 = 0.3;
/// The cosine of how far an edge may be turned against the step along it, 25 degrees (a guess).
const ALIGNED: f64 = 0.906;
/// Corners that a grid is begun at, the clearest first, before a picture is given up.
const SEEDS: usize = 16;

/// A corner and the directions of its two edges, of unit length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub at: DVec2,
    pub axes: [DVec2; 2],
}

impl Corner {
    /// Whether one of its edges runs along a step.
    fn runs_along(&self, step: DVec2) -> bool {
        self.axes.iter().any(|axis| axis.dot(step).abs() >= ALIGNED * step.length())
    }
}

/// The corners of the largest grid with their columns and rows, which begin at nought; empty where there is none.
pub(super) fn largest(corners: &[Corner]) -> Vec<([i32; 2], DVec2)> {
    let (mut best, mut taken) = (BTreeMap::new(), BTreeSet::new());
    for _ in 0..SEEDS {
        let Some(seed) = (0..corners.len()).find(|corner| !taken.contains(corner)) else { break };
        let grid = grow(corners, seed);
        taken.extend(grid.values().copied());
        taken.insert(seed);
        if grid.len() > best.len() {
            best = grid;
        }
    }
    let least = |side: usize| best.keys().map(|label: &[i32; 2]| label[side]).min().unwrap_or_default();
    let (left, top) = (least(0), least(1));
    best.iter().map(|(label, corner)| ([label[0] - left, label[1] - top], corners[*corner].at)).collect()
}

/// All corners that are reached from one.
fn grow(corners: &[Corner], seed: usize) -> BTreeMap<[i32; 2], usize> {
    let (mut labels, mut used) = (BTreeMap::from([([0, 0], seed)]), BTreeSet::from([seed]));
    let [Some(right), Some(down)] = corners[seed].axes.map(|axis| first_step(corners, seed, axis)) else {
        return BTreeMap::new();
    };
    let mut waiting = VecDeque::from([(seed, [0, 0], [right, down])]);
    while let Some((from, label, steps)) = waiting.pop_front() {
        for (side, sign) in [(0, 1), (0, -1), (1, 1), (1, -1)] {
            let mut next = label;
            next[side] += sign;
            let step = steps[side] * f64::from(sign);
            let target = corners[from].at + step;
            let free = (0..corners.len()).filter(|corner| !used.contains(corner));
            let away = |corner: &usize| corners[*corner].at.distance_squared(target);
            let near = free.min_by(|a, b| away(a).total_cmp(&away(b)));
            let fits =
                |corner: &usize| away(corner) <= (ASTRAY * step.length()).powi(2) && corners[*corner].runs_along(step);
            if let (Some(corner), false) = (near.filter(fits), labels.contains_key(&next)) {
                let mut steps = steps;
                steps[side] = (corners[corner].at - corners[from].at) * f64::from(sign);
                labels.insert(next, corner);
                used.insert(corner);
                waiting.push_back((corner, next, steps));
            }
        }
    }
    labels
}

/// The way to the nearest corner along an edge.
fn first_step(corners: &[Corner], seed: usize, axis: DVec2) -> Option<DVec2> {
    let steps = corners.iter().map(|corner| corner.at - corners[seed].at);
    let along = steps.filter(|step| *step != DVec2::ZERO && step.dot(axis).abs() >= ALIGNED * step.length());
    let step = along.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    Some(if step.dot(axis) < 0.0 { -step } else { step })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid seen aslant and bent, in an order of its own.
    fn slanted(columns: i32, rows: i32) -> Vec<Corner> {
        let at = |x: i32, y: i32| {
            let (x, y) = (f64::from(x), f64::from(y));
            let flat = DVec2::new(40.0 * x + 6.0 * y, 30.0 * y - 8.0 * x) / (1.0 + 0.04 * x + 0.02 * y);
            flat * (1.0 - 2e-7 * flat.length_squared())
        };
        let corner = |i: i32| {
            let (x, y) = (i % columns, i / columns);
            let edge = |dx, dy| (at(x + dx, y + dy) - at(x, y)).normalize();
            Corner { at: at(x, y), axes: [edge(0, 1), edge(1, 0)] }
        };
        (0..columns * rows).map(|i| corner(i * 11 % (columns * rows))).collect()
    }

    #[test]
    fn a_grid_is_found_among_others_and_labelled_along_its_edges() {
        let mut corners = slanted(7, 5);
        let lone = |x: f64, y: f64| Corner { at: DVec2::new(x, y), axes: [DVec2::X, DVec2::Y] };
        corners.insert(0, lone(900.0, 900.0));
        corners.insert(0, lone(960.0, 900.0));
        let found = largest(&corners);
        assert_eq!(found.len(), 35);
        let last = [0, 1].map(|side| found.iter().map(|(label, _)| label[side]).max().unwrap());
        assert!(last == [6, 4] || last == [4, 6], "{last:?}");
        // Corners of neighbouring labels are neighbours.
        let along: BTreeMap<_, _> = found.into_iter().collect();
        for ([u, v], at) in &along {
            let nearer = along.values().filter(|other| other.distance(*at) < 45.0).count();
            assert!(nearer >= 3, "{u} {v}");
        }
    }

    #[test]
    fn nothing_makes_no_grid() {
        assert!(largest(&[]).is_empty());
        assert!(largest(&slanted(1, 1)).is_empty());
    }
}
