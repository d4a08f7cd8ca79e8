//! From an organ tree to a plant of the Demeter model (spec/reconstruction.md "Fitting"): each organ alone, hung exactly
//! on its parent (stage 1), then all together (stage 2).
//!
//! The result is always inside the model: one connected tree, every base on its parent's curve, |β|, |γ| <= 3 σ. An
//! organ that cannot be fitted is left out and said, and what it carries hangs on its parent.

mod builder;
mod centreline;
mod error;
mod hanger;
mod hidden;
mod leaf;
pub(crate) mod leaflets;
mod lone;
mod loss;
mod orient;
mod pictured;
pub(crate) mod solver;
mod stem;
mod tube;
mod uncertainty;
mod whole;

use builder::{Builder, Source};
use demeter_frame::Pose;
pub use error::FitError;
pub(crate) use error::{MIN_EXTENT, MIN_POINTS};
use glam::{DQuat, DVec3};
pub use lone::{LoneBlade, lone_blade};
pub use pictured::{NODES, Pictured, pictured};

use crate::cloud::thinned;
use crate::model::{Plant, PlantError, Similarity, Species};
use crate::organs::OrganTree;
use crate::traits::Sigmas;

/// Most points of one organ that steer its fit: a blade of 20 cm has one every 3 mm then, and more only cost time.
const MAX_POINTS: usize = 2_000;

/// How well one organ fits.
#[derive(Clone, Debug, PartialEq)]
pub struct OrganFit {
    /// Index of the organ in the tree it was fitted to, `None` for a petiole that was put in to bridge a gap.
    pub source: Option<usize>,
    /// Points of its cloud.
    pub points: usize,
    /// Mean distance of its points to its surface, metres; `None` without points.
    pub residual: Option<f64>,
    /// Share of its surface that has data beside it; `None` for stems.
    pub visible_fraction: Option<f64>,
    /// The solver stopped because the cost no longer fell.
    pub converged: bool,
    /// How sure its traits are.
    pub sigmas: Sigmas,
}

/// A fitted plant.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The plant, valid by construction.
    pub plant: Plant,
    /// One entry an organ of the plant.
    pub organs: Vec<OrganFit>,
    /// Why organs of the tree were left out, in their order.
    pub dropped: Vec<FitError>,
}

/// Fits a plant. `up` is the unit vertical of the points' frame.
///
/// # Errors
/// [`FitError`] when the main stem cannot be fitted, or when the tree is none.
pub fn plant(tree: &OrganTree, species: &Species, up: DVec3) -> Result<Fitted, FitError> {
    fitted(tree, species, up, true)
}

/// Fits a plant to organs lifted from one picture, in its camera's frame, and moves its blades to where the picture
/// shows them: turn, size, shape and bends of each. `shown` gives each organ of the tree that is seen, where it hangs.
///
/// # Errors
/// Those of [`plant`].
pub fn in_picture(
    tree: &OrganTree,
    shown: impl Fn(usize, DVec3) -> Option<Pictured>,
    species: &Species,
    up: DVec3,
) -> Result<Fitted, FitError> {
    // A network's depth is a smooth surface: where a blade does not fit it, no scanner's noise has smeared it.
    let mut fitted = fitted(tree, species, up, false)?;
    pictured::to_picture(&mut fitted, shown, species, up)?;
    Ok(fitted)
}

/// A plant of points that are `scanned`, so that noise may have smeared its blades, or not.
fn fitted(tree: &OrganTree, species: &Species, up: DVec3, scanned: bool) -> Result<Fitted, FitError> {
    check(tree)?;
    let few: Vec<Vec<DVec3>> = tree.organs.iter().map(|organ| thinned(&organ.points, MAX_POINTS)).collect();
    let source = |organ: usize| Source { organ, kind: tree.organs[organ].kind, points: &few[organ] };
    error::check(0, &few[0])?;
    let base = hanger::ground(&tree.organs[0].points, up);
    let world_from_plant = Pose::new(DQuat::from_rotation_arc(DVec3::Z, up), base);
    let ground = Similarity { rotation: world_from_plant.rotation, translation: base, scale: 1.0 };
    let mut builder = Builder::new(source(0), ground, species, up);
    let mut dropped = Vec::new();
    // The plant's organ that carries what hangs on each organ of the tree: bridges and gaps shift the numbering.
    let mut placed = vec![0];
    for (organ, parent) in tree.parent.iter().enumerate().skip(1) {
        let parent = placed[parent.unwrap_or(0)];
        let hung = error::check(organ, &few[organ]).and_then(|()| builder.hang(parent, source(organ)));
        placed.push(hung.unwrap_or_else(|reason| {
            dropped.push(reason);
            parent
        }));
    }
    let counts = |organ: usize| tree.organs[organ].points.len();
    if scanned {
        builder.sharpen(counts);
    }
    leaflets::group(&mut builder.organs, species.habit);
    builder.doubt(counts);
    let mut plant = Plant { world_from_plant, organs: builder.organs };
    let outcomes = whole::refine(&mut plant, &builder.evidence, species)?;
    plant.validate()?;
    for (fit, outcome) in builder.fits.iter_mut().zip(outcomes) {
        fit.residual = outcome.residual;
        fit.sigmas.extend(outcome.sigmas);
        fit.points = fit.source.map_or(0, |organ| tree.organs[organ].points.len());
    }
    Ok(Fitted { plant, organs: builder.fits, dropped })
}

/// Whether parents stand before their children.
fn check(tree: &OrganTree) -> Result<(), PlantError> {
    if tree.organs.is_empty() || tree.parent.len() != tree.organs.len() {
        return Err(PlantError::Empty);
    }
    for (organ, parent) in tree.parent.iter().enumerate().skip(1) {
        match *parent {
            Some(parent) if parent < organ => {}
            Some(found) => return Err(PlantError::Parent { organ, found }),
            None => return Err(PlantError::MainStem { organ, found: "a second root" }),
        }
    }
    Ok(())
}
