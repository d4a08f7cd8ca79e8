//! A leaf's outline in the leaf's own frame: base at (0, 0), tip at (0, 1), seen from above.

use glam::DVec2;
use image::GrayImage;

use super::contour::{area, contour, is_simple};
use super::mask::{BladePixels, Region};
use crate::model::leaf::Side;

/// Equal steps along each side of an outline, base to tip.
pub const STEPS: usize = 200;
/// Points within this share of the leaf's extent from its end are that end: a leaf may end flat.
const END_SHARE: f64 = 0.01;

/// Why a contour is no leaf's outline.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum OutlineError {
    /// Nothing, or nearly nothing, is leaf.
    #[error("mask: expected a region of at least {expected} pixels, found {found}")]
    Small {
        /// Least pixels.
        expected: usize,
        /// Pixels of the largest region.
        found: usize,
    },
    /// A contour that crosses or touches itself, such as a figure eight.
    #[error("contour: expected one that does not cross itself")]
    Crossed,
    /// A leaf that is not oval where an oval one was asked for.
    #[error("contour: expected every row's line to meet it at most twice")]
    NotOval,
    /// Lobes too deep for the grid.
    #[error("grid: expected no folded cell, found {found}")]
    Folded {
        /// Folded cells.
        found: usize,
    },
    /// Base and tip are one, or a number is not finite.
    #[error("contour: expected finite points with base and tip apart")]
    Degenerate,
}

/// Where base and tip of a leaf are in its picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Found: the base is where a petiole hangs; without a petiole, base and tip are the two points farthest apart, and
    /// the base is the one nearer to the middle of the blade, as in ovate leaves.
    Auto,
    /// The base is the picture's uppermost point of the leaf, the tip the lowest.
    Top,
    /// The other way.
    Bottom,
    /// The base is at the left, the tip at the right.
    Left,
    /// The other way.
    Right,
}

impl Ends {
    /// Coordinate of a pixel (y down) that grows from base to tip; 0 where that is not known.
    pub(super) fn along(self, x: f64, y: f64) -> f64 {
        match self {
            Self::Auto => 0.0,
            Self::Top => y,
            Self::Bottom => -y,
            Self::Left => x,
            Self::Right => -x,
        }
    }

    /// Indices of base and tip in a contour with y up.
    fn of(self, contour: &[DVec2], junction: Option<DVec2>) -> (usize, usize) {
        let nearest = |p: DVec2| extreme(contour, |q| -p.distance_squared(q));
        let farthest = |p: DVec2| extreme(contour, |q| p.distance(q));
        if let Some(junction) = junction {
            let base = nearest(DVec2::new(junction.x, -junction.y));
            let tip =
                if self == Self::Auto { farthest(contour[base]) } else { extreme(contour, |q| self.along(q.x, -q.y)) };
            return (base, tip);
        }
        if self != Self::Auto {
            return (extreme(contour, |q| -self.along(q.x, -q.y)), extreme(contour, |q| self.along(q.x, -q.y)));
        }
        // Twice the farthest point from the last one is the diameter of a convex shape, or close to it.
        let middle = centroid(contour);
        let one = farthest(contour[farthest(middle)]);
        let other = farthest(contour[one]);
        let nearer = contour[one].distance(middle) <= contour[other].distance(middle);
        if nearer { (one, other) } else { (other, one) }
    }
}

/// The middle of the stretch of a closed line around its highest point that is as high within [`END_SHARE`].
fn extreme(points: &[DVec2], height: impl Fn(DVec2) -> f64) -> usize {
    let n = points.len();
    let heights: Vec<f64> = points.iter().map(|p| height(*p)).collect();
    let top = (0..n).max_by(|a, b| heights[*a].total_cmp(&heights[*b])).unwrap_or(0);
    let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let limit = heights[top] - END_SHARE * (heights[top] - low);
    let reach = |step: usize| (1..n).take_while(|k| heights[(top + k * step) % n] >= limit).count();
    let (forward, backward) = (reach(1), reach(n - 1));
    (2 * n + top + forward.div_ceil(2) - backward.div_ceil(2)) % n
}

/// The middle of a polygon's area.
fn centroid(polygon: &[DVec2]) -> DVec2 {
    let moment = |(a, b): (DVec2, DVec2)| (a + b) * a.perp_dot(b);
    super::contour::edges(polygon).map(moment).sum::<DVec2>() / (6.0 * area(polygon))
}

/// An outline: both sides from base to tip in [`STEPS`] equal steps of their length.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    left: Vec<DVec2>,
    right: Vec<DVec2>,
}

/// A mask's outline and what its pixels say of its quality.
#[derive(Clone, Debug)]
pub struct Traced {
    /// The outline.
    pub outline: Outline,
    /// Area of what is not the leaf, as a share of the leaf.
    pub others: f64,
    /// Share of the contour in its longest stretch on the picture's edge, where the leaf may be cut off.
    pub on_edge: f64,
}

impl Outline {
    /// Traces the leaf of a mask (white on black).
    ///
    /// # Errors
    /// [`OutlineError`] when there is no leaf in it or base and tip cannot be told apart.
    pub fn trace(mask: &GrayImage, ends: Ends) -> Result<Traced, OutlineError> {
        let blade = BladePixels::of(mask, ends)?;
        let contour = contour(&blade.region);
        let (base, tip) = ends.of(&contour, blade.junction);
        let on_edge = on_edge(&contour, &blade.region);
        Ok(Traced { outline: Self::new(&contour, base, tip)?, others: blade.others, on_edge })
    }

    /// The outline of a closed contour (either way round, seen from above with y up) whose base and tip are the points
    /// with those indices.
    ///
    /// # Errors
    /// [`OutlineError`] when base and tip coincide or the contour crosses itself.
    pub fn new(contour: &[DVec2], base: usize, tip: usize) -> Result<Self, OutlineError> {
        let finite = contour.iter().all(|p| p.is_finite());
        let (Some(origin), Some(end)) = (contour.get(base), contour.get(tip)) else {
            return Err(OutlineError::Degenerate);
        };
        let axis = *end - *origin;
        let scale = axis.length_squared();
        if !(finite && scale > 0.0) {
            return Err(OutlineError::Degenerate);
        }
        // The rotation that takes the axis to +y, divided by its length.
        let align = |p: DVec2| DVec2::new(-axis.perp_dot(p - *origin), axis.dot(p - *origin)) / scale;
        let n = contour.len();
        let walk = |step: usize| -> Vec<DVec2> {
            let count = (0..n).take_while(|k| (base + k * step) % n != tip).count();
            resampled(&(0..=count).map(|k| align(contour[(base + k * step) % n])).collect::<Vec<_>>())
        };
        let (onward, back) = (walk(1), walk(n - 1));
        let (right, left) = if area(contour) > 0.0 { (onward, back) } else { (back, onward) };
        let outline = Self { left, right };
        if is_simple(&outline.polygon()) { Ok(outline) } else { Err(OutlineError::Crossed) }
    }

    /// One side from base to tip: `STEPS + 1` points.
    #[must_use]
    pub fn side(&self, side: Side) -> &[DVec2] {
        match side {
            Side::Left => &self.left,
            Side::Right => &self.right,
        }
    }

    /// The point of a side after a share `t` in 0..=1 of its length.
    #[must_use]
    pub fn at(&self, side: Side, t: f64) -> DVec2 {
        let x = t.clamp(0.0, 1.0) * STEPS as f64;
        let i = (x as usize).min(STEPS - 1);
        self.side(side)[i].lerp(self.side(side)[i + 1], x - i as f64)
    }

    /// The closed contour, counter-clockwise from the base: `2 STEPS` points.
    #[must_use]
    pub fn polygon(&self) -> Vec<DVec2> {
        self.right[..STEPS].iter().chain(self.left[1..].iter().rev()).copied().collect()
    }

    /// The same leaf `factor` times as wide.
    #[must_use]
    pub fn widened(&self, factor: f64) -> Self {
        let widen = |side: &[DVec2]| side.iter().map(|p| DVec2::new(p.x * factor, p.y)).collect();
        Self { left: widen(&self.left), right: widen(&self.right) }
    }

    /// The same leaf seen from below.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mirror = |side: &[DVec2]| side.iter().map(|p| DVec2::new(-p.x, p.y)).collect();
        Self { left: mirror(&self.right), right: mirror(&self.left) }
    }
}

/// A line in [`STEPS`] equal steps of its length.
pub(super) fn resampled(line: &[DVec2]) -> Vec<DVec2> {
    let mut lengths = vec![0.0];
    for pair in line.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]));
    }
    let total = lengths[lengths.len() - 1];
    let mut segment = 0;
    let mut points: Vec<DVec2> = (0..STEPS)
        .map(|k| {
            let length = total * k as f64 / STEPS as f64;
            while segment + 2 < line.len() && lengths[segment + 1] <= length {
                segment += 1;
            }
            let step = (lengths[segment + 1] - lengths[segment]).max(f64::MIN_POSITIVE);
            line[segment].lerp(line[segment + 1], ((length - lengths[segment]) / step).clamp(0.0, 1.0))
        })
        .collect();
    points.push(line[line.len() - 1]);
    points
}

/// The longest stretch of a contour within half a pixel of the picture's edge, as a share of its points.
fn on_edge(contour: &[DVec2], region: &Region) -> f64 {
    let (width, height) = region.size();
    let near = |x: f64, size: usize| x < 0.5 || x > size as f64 - 0.5;
    let mut longest = 0;
    let mut stretch = 0;
    // Twice around, because a stretch may go over the contour's first point.
    for p in contour.iter().chain(contour) {
        stretch = if near(p.x, width) || near(-p.y, height) { stretch + 1 } else { 0 };
        longest = longest.max(stretch);
    }
    longest.min(contour.len()) as f64 / contour.len() as f64
}
