//! Which scans to learn from: a stated rule, and the reason for each scan that it rejects.

use std::fmt;

use super::contour::{area, distance};
use super::outline::{Outline, Traced};
use crate::statistics::{deviation, median};

/// A scan that is too unlike the others to be a leaf's true outline: bites, tears, masks drawn across missing parts.
///
/// The rule, in order:
/// 1. other regions than the leaf cover more than 1 % of its area;
/// 2. more than 10 % of the contour lies in one stretch on the picture's edge;
/// 3. the base-tip line is shorter than 0.6 of the leaf's largest extent;
/// 4. among at least 12 scans, a [`Measure`] is farther from the median than 3.5 robust
///    standard deviations (1.4826 times the median absolute deviation).
///
/// No rule looks at the error of a learned shape, so rejecting does not choose what is easy to learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// More than one region.
    Others {
        /// Area of the others as a share of the leaf's.
        found: f64,
    },
    /// Cut by the picture's edge.
    Cut {
        /// Share of the contour on the edge.
        found: f64,
    },
    /// Base and tip are not the leaf's ends.
    Axis {
        /// Base-tip distance over the largest extent.
        found: f64,
    },
    /// Unlike the other scans.
    Outlier {
        /// In what.
        measure: Measure,
        /// Its value, leaf lengths or shares of them.
        found: f64,
        /// The largest distance from `median` that passes.
        limit: f64,
        /// The scans' median.
        median: f64,
    },
}

/// What is compared between scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Depth of the deepest bay of the contour under its convex hull, leaf lengths: bites and tears.
    Bay,
    /// Root mean square distance of the contour from itself averaged over a twentieth of each side, leaf lengths: ragged
    /// edges, corners of straight cuts.
    Raggedness,
    /// Area right of the base-tip line less area left of it, as a share of both: a half that is missing.
    Lopsidedness,
    /// Mean width, leaf lengths: a tip or a base that is missing.
    Width,
}

/// Share of the leaf's area that other regions may cover.
const OTHERS_LIMIT: f64 = 0.01;
/// Share of the contour that may lie on the picture's edge in one stretch; leaves that only touch it stay.
const EDGE_LIMIT: f64 = 0.1;
/// Least base-tip distance over the largest extent (cordate and lobed leaves reach beyond their ends).
const AXIS_LIMIT: f64 = 0.6;
/// Robust standard deviations that pass: the usual 3.5 (Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993).
const OUTLIER_SIGMAS: f64 = 3.5;
/// Fewer scans than this have no reliable spread (a guess).
const LEAST_SCANS: usize = 12;
/// Points of each side over which raggedness averages, of 200.
const AVERAGED: usize = 11;

impl Measure {
    const ALL: [Self; 4] = [Self::Bay, Self::Raggedness, Self::Lopsidedness, Self::Width];

    /// Its value for an outline.
    #[must_use]
    pub fn of(self, outline: &Outline) -> f64 {
        let polygon = outline.polygon();
        match self {
            Self::Bay => {
                let hull = hull(&polygon);
                polygon.iter().map(|p| distance(&hull, *p)).fold(0.0, f64::max)
            }
            Self::Raggedness => {
                let n = polygon.len();
                let average = |i: usize| {
                    let around = (0..AVERAGED).map(|k| polygon[(i + n + k - AVERAGED / 2) % n]);
                    around.sum::<glam::DVec2>() / AVERAGED as f64
                };
                let squares = (0..n).map(|i| polygon[i].distance_squared(average(i))).sum::<f64>();
                (squares / n as f64).sqrt()
            }
            Self::Lopsidedness => {
                // Each side closed by the base-tip line; the left one runs the other way round.
                let [left, right] = crate::model::leaf::Side::BOTH.map(|side| area(outline.side(side)));
                (right + left) / area(&polygon)
            }
            Self::Width => area(&polygon),
        }
    }

    /// Too little of these is no fault.
    fn one_sided(self) -> bool {
        matches!(self, Self::Bay | Self::Raggedness)
    }
}

/// For each scan the reason why it is rejected, if it is.
#[must_use]
pub fn rejections(scans: &[Traced]) -> Vec<Option<Rejection>> {
    let mut reasons: Vec<Option<Rejection>> = scans.iter().map(alone).collect();
    for measure in Measure::ALL {
        let values: Vec<f64> = scans.iter().map(|scan| measure.of(&scan.outline)).collect();
        let passed: Vec<f64> = values.iter().zip(&reasons).filter(|(_, r)| r.is_none()).map(|(x, _)| *x).collect();
        if passed.len() < LEAST_SCANS {
            continue;
        }
        let median = median(&passed).unwrap_or(0.0);
        let limit = OUTLIER_SIGMAS * deviation(passed.iter().map(|x| x - median));
        for (reason, found) in reasons.iter_mut().zip(values) {
            let off = if measure.one_sided() { found - median } else { (found - median).abs() };
            if off > limit {
                reason.get_or_insert(Rejection::Outlier { measure, found, limit, median });
            }
        }
    }
    reasons
}

/// The rules that need no other scans.
fn alone(scan: &Traced) -> Option<Rejection> {
    let polygon = scan.outline.polygon();
    let extent = polygon.iter().flat_map(|a| polygon.iter().map(|b| a.distance_squared(*b))).fold(0.0, f64::max).sqrt();
    // The base-tip distance is 1 in the outline's own unit.
    let axis = 1.0 / extent;
    if scan.others > OTHERS_LIMIT {
        Some(Rejection::Others { found: scan.others })
    } else if scan.on_edge > EDGE_LIMIT {
        Some(Rejection::Cut { found: scan.on_edge })
    } else if axis < AXIS_LIMIT {
        Some(Rejection::Axis { found: axis })
    } else {
        None
    }
}

/// The convex hull of points, counter-clockwise (Andrew's monotone chain).
fn hull(points: &[glam::DVec2]) -> Vec<glam::DVec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = glam::DVec2>| {
        let mut chain: Vec<glam::DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(p - b) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    hull
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Others { found } => {
                write!(f, "other regions: expected at most {OTHERS_LIMIT} of the leaf's area, found {found:.3}")
            }
            Self::Cut { found } => {
                write!(f, "cut by the picture's edge: expected at most {EDGE_LIMIT} of the contour, found {found:.3}")
            }
            Self::Axis { found } => {
                write!(f, "base and tip: expected at least {AXIS_LIMIT} of the leaf's extent apart, found {found:.3}")
            }
            Self::Outlier { measure, found, limit, median } => {
                let name = match measure {
                    Measure::Bay => "deepest bay",
                    Measure::Raggedness => "raggedness",
                    Measure::Lopsidedness => "lopsidedness",
                    Measure::Width => "mean width",
                };
                write!(f, "{name}: expected within {limit:.4} of the median {median:.4}, found {found:.4}")
            }
        }
    }
}
