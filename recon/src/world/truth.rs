use glam::{DQuat, DVec3};
use serde::Serialize;

use super::scene::{Scene, Standing};
use crate::export::kind_name;
use crate::model::{Form, PlantError, Species, forward};
use crate::organs::ScaleSource;
use crate::traits::{PlantTraits, keys};

/// What is true of a synthetic plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlantTruth {
    /// Name of its species.
    pub species: String,
    /// Its main stem's base in the world, metres.
    pub position: DVec3,
    /// Its turn, `[x, y, z, w]`.
    pub rotation: DQuat,
    /// Highest point above the base, metres.
    pub height: f64,
    /// Leaves, a compound leaf once.
    pub leaf_count: usize,
    /// Blades and leaflets.
    pub blade_count: usize,
    /// One side of all blades, square metres.
    pub leaf_area: f64,
    /// Its parameters.
    pub organs: Vec<OrganTruth>,
}

/// The parameters of an organ, as in [`crate::model::Organ`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OrganTruth {
    /// `main_stem`, `stem` or `leaf`.
    pub kind: &'static str,
    /// Index of its parent.
    pub parent: Option<usize>,
    /// Attachment on the parent, 0..=1.
    pub d: f64,
    /// Rotation, `[x, y, z, w]`.
    pub rotation: DQuat,
    /// Size relative to the parent's.
    pub scale: f64,
    /// Length in metres.
    pub length: f64,
    /// Shape in σ, blades only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beta: Vec<f64>,
    /// Deformation in σ.
    pub gamma: Vec<f64>,
    /// Stems: radius in units of length; blades: s_x.
    pub size: f64,
    /// Which leaf a blade belongs to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaf: Option<u16>,
}

/// The truth of every plant of a scene.
///
/// # Errors
/// [`PlantError`] when a plant is none, which [`Scene::new`] rules out.
pub fn truth<'a>(scene: &Scene, species: impl Fn(&str) -> Option<&'a Species>) -> Result<Vec<PlantTruth>, PlantError> {
    scene.plants.iter().filter_map(|plant| species(&plant.species).map(|species| of(plant, species))).collect()
}

fn of(standing: &Standing, species: &Species) -> Result<PlantTruth, PlantError> {
    let plant = &standing.plant;
    let posed = forward(plant, species)?;
    let traits = PlantTraits::of(plant, species, ScaleSource::Input)?.plant;
    let value = |key: &str| traits.get(key).map_or(0.0, |quantity| quantity.value);
    let organs = plant.organs.iter().zip(&posed.world_from_organ).map(|(organ, at)| {
        let (beta, gamma, size, leaf) = match &organ.form {
            Form::Stem { gamma, radius } => (Vec::new(), gamma, *radius, None),
            Form::Leaf { blade, leaf } => (blade.beta.clone(), &blade.gamma, blade.width, Some(*leaf)),
        };
        OrganTruth {
            kind: kind_name(organ.kind()),
            parent: organ.parent,
            d: organ.joint.d,
            rotation: organ.joint.rotation,
            scale: organ.joint.scale,
            length: at.scale,
            beta,
            gamma: gamma.clone(),
            size,
            leaf,
        }
    });
    Ok(PlantTruth {
        species: standing.species.clone(),
        position: plant.world_from_plant.translation,
        rotation: plant.world_from_plant.rotation,
        height: value(keys::HEIGHT),
        leaf_count: value(keys::LEAF_COUNT) as usize,
        blade_count: value(keys::BLADE_COUNT) as usize,
        leaf_area: value(keys::LEAF_AREA),
        organs: organs.collect(),
    })
}
