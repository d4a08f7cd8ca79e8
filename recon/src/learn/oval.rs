//! The grid of an oval leaf: every row's line crosses the contour once on each side.

use glam::DVec2;

use super::outline::{Outline, OutlineError};
use crate::model::leaf::{COLUMNS, POINTS, ROWS, Side, node};

/// Leaves may reach beyond base and tip by this share of their length, half a row: the grid cannot show less.
const BEYOND: f64 = 0.5 / (ROWS - 1) as f64;

/// The grid `[45*43]` with equal steps between the two crossings of each row's line (spec "Leaf template", a).
///
/// # Errors
/// [`OutlineError::NotOval`] when a row's line meets the contour more than twice, or the leaf reaches beyond its ends.
pub fn oval(outline: &Outline) -> Result<Vec<DVec2>, OutlineError> {
    if !outline.polygon().iter().all(|p| (-BEYOND..=1.0 + BEYOND).contains(&p.y)) {
        return Err(OutlineError::NotOval);
    }
    let mut grid = vec![DVec2::ZERO; POINTS];
    grid[node(ROWS - 1, 0)..].fill(DVec2::Y);
    for i in 1..ROWS - 1 {
        let y = i as f64 / (ROWS - 1) as f64;
        let [left, right] = Side::BOTH.map(|side| crossing(outline.side(side), y));
        let (Some(left), Some(right)) = (left, right) else { return Err(OutlineError::NotOval) };
        for j in 0..COLUMNS {
            let t = j as f64 / (COLUMNS - 1) as f64;
            grid[node(i, j)] = DVec2::new(left + t * (right - left), y);
        }
    }
    Ok(grid)
}

/// x where a side crosses the height y, if it does so once.
fn crossing(side: &[DVec2], y: f64) -> Option<f64> {
    let mut crossed = side.windows(2).filter(|pair| (pair[0].y > y) != (pair[1].y > y));
    let (pair, again) = (crossed.next()?, crossed.next());
    let x = pair[0].x + (y - pair[0].y) / (pair[1].y - pair[0].y) * (pair[1].x - pair[0].x);
    again.is_none().then_some(x)
}
