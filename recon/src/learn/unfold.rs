//! Unfolding the few cells of a grid that are coarser than the lobe they cross.
//!
//! The harmonic map is one-to-one, but a cell joins four of its points by straight lines, and where the map bends within
//! one cell they may cross. Inner nodes of such cells move, each to where the smallest corner around it is largest.

use std::f64::consts::TAU;

use glam::DVec2;

use super::contour::area;
use crate::model::leaf::{COLUMNS, POINTS, ROWS, node};

/// Corners smaller than such a share of the mean cell are opened; the next share is tried where the one before leaves
/// folds, because then more of the neighbours make room.
const MARGINS: [f64; 3] = [0.03, 0.1, 0.3];
/// Sweeps over the grid for each margin; most grids need fewer than ten.
const SWEEPS: usize = 20;
/// Directions that a node tries; the smallest of linear functions has ridges, which few directions miss.
const DIRECTIONS: usize = 16;
/// A node's search ends below this share of its first step.
const FINEST: f64 = 1e-3;

/// Number of folded cells of a flat grid `[45*43]`: those with a corner that does not open to the left of its edges. Where
/// base or tip make a cell a triangle, it is taken as one.
#[must_use]
pub fn folded(grid: &[DVec2]) -> usize {
    let cells = (0..ROWS - 1).flat_map(|i| (0..COLUMNS - 1).map(move |j| (i, j)));
    cells.filter(|(i, j)| least(grid, *i, *j) <= 0.0).count()
}

/// Twice the area of the smallest corner of cell (i, j): of the triangle of a node and its two neighbours in the cell.
fn least(grid: &[DVec2], i: usize, j: usize) -> f64 {
    let [a, b, c, d] = [node(i, j), node(i, j + 1), node(i + 1, j + 1), node(i + 1, j)].map(|n| grid[n]);
    let corner = |at: DVec2, next: DVec2, before: DVec2| (next - at).perp_dot(before - at);
    match i {
        0 => corner(a, c, d),
        i if i == ROWS - 2 => corner(a, b, c),
        _ => corner(a, b, d).min(corner(b, c, a)).min(corner(c, d, b)).min(corner(d, a, c)),
    }
}

/// Moves inner nodes until no cell is folded, or as few as can be.
pub(super) fn unfold(grid: &mut [DVec2]) {
    let cell = 2.0 * area(&rim(grid)) / POINTS as f64;
    for sweep in 0..MARGINS.len() * SWEEPS {
        if folded(grid) == 0 {
            break;
        }
        open_all(grid, MARGINS[sweep / SWEEPS] * cell, sweep % 2 == 0);
    }
}

/// Opens every node with a corner below `margin` in turn, from the base or from the tip.
fn open_all(grid: &mut [DVec2], margin: f64, from_base: bool) {
    for i in 1..ROWS - 1 {
        let i = if from_base { i } else { ROWS - 1 - i };
        for j in 1..COLUMNS - 1 {
            if around(grid, i, j) < margin {
                open(grid, i, j);
            }
        }
    }
}

/// The smallest corner of the four cells around an inner node.
fn around(grid: &[DVec2], i: usize, j: usize) -> f64 {
    let cells = [(i - 1, j - 1), (i - 1, j), (i, j - 1), (i, j)];
    cells.map(|(i, j)| least(grid, i, j)).into_iter().fold(f64::MAX, f64::min)
}

/// Moves a node to where the smallest corner around it is largest.
fn open(grid: &mut [DVec2], i: usize, j: usize) {
    let n = node(i, j);
    let mut best = around(grid, i, j);
    let neighbours = [node(i - 1, j), node(i + 1, j), node(i, j - 1), node(i, j + 1)];
    let first = neighbours.map(|m| grid[m].distance(grid[n])).into_iter().fold(0.0, f64::max) / 2.0;
    let mut step = first;
    while step > first * FINEST {
        let from = grid[n];
        let mut to = from;
        for k in 0..DIRECTIONS {
            grid[n] = from + step * DVec2::from_angle(TAU * k as f64 / DIRECTIONS as f64);
            let found = around(grid, i, j);
            if found > best {
                (best, to) = (found, grid[n]);
            }
        }
        grid[n] = to;
        if to == from {
            step /= 2.0;
        }
    }
}

/// The edge of a grid, counter-clockwise from the base.
fn rim(grid: &[DVec2]) -> Vec<DVec2> {
    let right = (0..ROWS - 1).map(|i| grid[node(i, COLUMNS - 1)]);
    right.chain((1..ROWS).rev().map(|i| grid[node(i, 0)])).collect()
}
