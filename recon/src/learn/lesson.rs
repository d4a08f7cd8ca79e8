//! What one cloud teaches: raw joint angles of its organs, fitted one by one with the smooth modes.

use glam::DVec3;
use nalgebra::DVector;

use super::joints::{Hanging, hanging};
use super::mirror::without_roll;
use crate::cloud::diagonal;
use crate::fit::{self, FitError, OrganFit};
use crate::model::leaf::Blade;
use crate::model::{Form, PlantError, Species, forward, stem};
use crate::organs::OrganCloud;
use crate::tree::{self, TreeError};

/// Largest mean distance between points and fit, as a share of the organ's length: ten times what a good scan has.
const MAX_RESIDUAL: f64 = 0.05;
/// Least share of a blade with points beside it; half a blade does not tell how the other half bends.
const MIN_VISIBLE: f64 = 0.8;
/// Diagonal to which a leaf of unknown unit is scaled: within every species' range of blades.
const LEAF_METRES: f64 = 0.1;
/// Fewest points of an organ that tell its bends (a guess).
pub(super) const MIN_POINTS: usize = 60;

/// What one cloud teaches.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lesson {
    /// Joint angles `[3700]` of its blades, in the smooth modes' span.
    pub leaves: Vec<DVector<f64>>,
    /// Flat grids `[45*43*2]` of the same blades, before s_x.
    pub shapes: Vec<DVector<f64>>,
    /// Joint angles `[46]` of its stems, rolled to the gauge.
    pub stems: Vec<DVector<f64>>,
    /// How its organs hang.
    pub hanging: Vec<Hanging>,
    /// Organs that taught nothing, with the reason.
    pub refused: Vec<Refused>,
}

/// An organ that is not learned from.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// Its index in the fitted plant; 0 of a cloud that is one leaf.
    pub organ: usize,
    /// Why.
    pub reason: Refusal,
}

/// Why an organ is not learned from.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The fit lies too far from the points to tell the organ's bends.
    #[error("expected a fit within {expected} of the organ's length, found {found:.3}")]
    Residual {
        /// Largest mean distance, as a share of the length.
        expected: f64,
        /// Mean distance found.
        found: f64,
    },
    /// Too little of the blade was scanned.
    #[error("expected at least {expected} of the blade with points beside it, found {found:.2}")]
    Visible {
        /// Least share.
        expected: f64,
        /// Share found.
        found: f64,
    },
    /// Too few points.
    #[error("expected at least {expected} points, found {found}")]
    Points {
        /// Least number.
        expected: usize,
        /// Number found.
        found: usize,
    },
}

/// Why a cloud teaches nothing at all.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum LessonError {
    /// Its organs make no tree.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// They cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The fit is no plant.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A cloud without extent or with numbers that are not finite.
    #[error("expected finite points with an extent, found none")]
    Extent,
}

impl Lesson {
    /// From the organs of a plant. `rich` is the species with rich bends ([`super::rich`]); `up` points up.
    ///
    /// # Errors
    /// [`LessonError`] when the organs make no plant.
    pub fn of_plant(organs: Vec<OrganCloud>, up: DVec3, rich: &Species) -> Result<Self, LessonError> {
        let fitted = fit::plant(&tree::build(organs)?, rich, up)?;
        let posed = forward(&fitted.plant, rich)?;
        let mut lesson = Self { hanging: hanging(&fitted.plant), ..Self::default() };
        for (organ, (form, fit)) in fitted.plant.organs.iter().zip(&fitted.organs).enumerate() {
            // A petiole that was put in has no points and is no observation.
            if fit.residual.is_none() {
                continue;
            }
            match refusal(fit, posed.world_from_organ[organ].scale) {
                Some(reason) => lesson.refused.push(Refused { organ, reason }),
                None => lesson.add(&form.form, rich),
            }
        }
        Ok(lesson)
    }

    /// From a cloud that is one blade, in any unit, whose base may be at either end. `up` is on the side of its upper
    /// face.
    ///
    /// # Errors
    /// [`LessonError`] for a cloud without extent or of hardly any points.
    pub fn of_leaf(points: &[DVec3], up: DVec3, rich: &Species) -> Result<Self, LessonError> {
        let size = diagonal(points).filter(|d| d.is_finite() && *d > 0.0).ok_or(LessonError::Extent)?;
        let points: Vec<DVec3> = points.iter().map(|p| (*p - points[0]) * (LEAF_METRES / size)).collect();
        let found = fit::lone_blade(&points, None, up, rich)?;
        let mut lesson = Self::default();
        match refusal(&found.fit, found.world_from_blade.scale) {
            Some(reason) => lesson.refused.push(Refused { organ: 0, reason }),
            None => lesson.add_blade(&found.blade, rich),
        }
        Ok(lesson)
    }

    fn add_blade(&mut self, blade: &Blade, rich: &Species) {
        self.leaves.push(rich.leaf.deform.at(&blade.gamma));
        self.shapes.push(rich.leaf.shape.at(&blade.beta));
    }

    fn add(&mut self, form: &Form, rich: &Species) {
        match form {
            Form::Leaf { blade, .. } => self.add_blade(blade, rich),
            Form::Stem { gamma, .. } => {
                let gauge = stem::gauge(&rich.stem.jacobian(gamma).points);
                self.stems.push(without_roll(&rich.stem.deform.at(gamma), gauge));
            }
        }
    }
}

/// Why a fit to an organ of `length` metres tells nothing.
fn refusal(fit: &OrganFit, length: f64) -> Option<Refusal> {
    if fit.points < MIN_POINTS {
        return Some(Refusal::Points { expected: MIN_POINTS, found: fit.points });
    }
    let residual = fit.residual.map(|metres| metres / length).filter(|share| *share > MAX_RESIDUAL);
    if let Some(found) = residual {
        return Some(Refusal::Residual { expected: MAX_RESIDUAL, found });
    }
    fit.visible_fraction.filter(|v| *v < MIN_VISIBLE).map(|found| Refusal::Visible { expected: MIN_VISIBLE, found })
}
