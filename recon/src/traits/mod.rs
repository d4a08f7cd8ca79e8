//! Traits of plants and organs (spec/reconstruction.md "Traits"); [`keys`] defines each.

mod blade;
mod branching;
mod hull;
pub mod keys;
mod shadow;
mod uncertainty;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::model::{Detail, Form, Knots, Plant, PlantError, PlantMesh, Species, forward};
use crate::organs::ScaleSource;
use crate::statistics::mean;
pub use uncertainty::{Sigma, Sigmas, VISIBLE};

/// The units of traits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Metres.
    #[serde(rename = "m")]
    Metre,
    /// Square metres.
    #[serde(rename = "m2")]
    SquareMetre,
    /// Cubic metres.
    #[serde(rename = "m3")]
    CubicMetre,
    /// Radians.
    #[serde(rename = "rad")]
    Radian,
    /// A count or a ratio.
    #[serde(rename = "1")]
    One,
    /// Per metre.
    #[serde(rename = "1/m")]
    PerMetre,
}

impl Unit {
    /// True when a value in this unit means nothing without a metric scale.
    #[must_use]
    pub const fn is_metric(self) -> bool {
        !matches!(self, Self::Radian | Self::One)
    }
}

impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.serialize(f)
    }
}

/// A measured value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// The value.
    pub value: f64,
    /// Its unit.
    pub unit: Unit,
    /// Standard uncertainty in the same unit, `None` when it was not estimated.
    pub sigma: Option<f64>,
}

/// Traits by their key.
pub type Traits = BTreeMap<String, Quantity>;

/// The traits of a plant and of each of its organs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlantTraits {
    /// Of the plant as a whole.
    pub plant: Traits,
    /// Of each organ, in the plant's order.
    pub organs: Vec<Traits>,
}

impl PlantTraits {
    /// Measures a plant; sigmas are not known here. Without a metric scale all traits that need one are withheld.
    ///
    /// # Errors
    /// [`PlantError`] when the plant is none.
    pub fn of(plant: &Plant, species: &Species, scale_source: ScaleSource) -> Result<Self, PlantError> {
        let posed = forward(plant, species)?;
        let mesh = PlantMesh::of(&posed, Detail::Control, Knots::Uniform);
        let mut organs: Vec<Traits> = branching::traits(plant, &posed);
        let areas = blade::areas(&mesh, plant.organs.len());
        for (i, organ) in plant.organs.iter().enumerate() {
            if let (Form::Leaf { .. }, Some(parent)) = (&organ.form, organ.parent) {
                let stem = branching::direction(&posed.control[parent], organ.joint.d);
                blade::measure(&mut organs[i], &posed.control[i], areas[i], stem);
            }
        }
        let mut whole = summary(plant, &organs);
        let base = posed.world_from_organ[0].translation.z;
        let top = mesh.positions.iter().map(|p| p.z).fold(base, f64::max);
        put(&mut whole, keys::HEIGHT, top - base, Unit::Metre);
        put(&mut whole, keys::PROJECTED_AREA, shadow::area(&mesh), Unit::SquareMetre);
        put(&mut whole, keys::HULL_VOLUME, hull::volume(&mesh.positions), Unit::CubicMetre);
        if scale_source == ScaleSource::None {
            for traits in organs.iter_mut().chain([&mut whole]) {
                traits.retain(|_, quantity| !quantity.unit.is_metric());
            }
        }
        Ok(Self { plant: whole, organs })
    }
}

/// What the plant's traits take from its organs'.
fn summary(plant: &Plant, organs: &[Traits]) -> Traits {
    let mut whole = Traits::new();
    let leaves: Vec<u16> = plant
        .organs
        .iter()
        .filter_map(|o| match o.form {
            Form::Leaf { leaf, .. } => Some(leaf),
            Form::Stem { .. } => None,
        })
        .collect();
    let distinct: std::collections::BTreeSet<u16> = leaves.iter().copied().collect();
    put(&mut whole, keys::BLADE_COUNT, leaves.len() as f64, Unit::One);
    put(&mut whole, keys::LEAF_COUNT, distinct.len() as f64, Unit::One);
    let values = |key: &str| organs.iter().filter_map(|t| Some(t.get(key)?.value)).collect::<Vec<f64>>();
    let areas = values(keys::LEAF_AREA);
    let area: f64 = areas.iter().sum();
    put(&mut whole, keys::LEAF_AREA, area, Unit::SquareMetre);
    for key in [keys::LEAF_LENGTH, keys::LEAF_WIDTH] {
        if let Some(mean) = mean(values(key)) {
            put(&mut whole, key, mean, Unit::Metre);
        }
    }
    if area > 0.0 {
        let weighted: f64 = values(keys::LEAF_INCLINATION).iter().zip(&areas).map(|(angle, area)| angle * area).sum();
        put(&mut whole, keys::LEAF_INCLINATION, weighted / area, Unit::Radian);
    }
    for key in [keys::STEM_LENGTH, keys::STEM_DIAMETER, keys::STEM_LEAN] {
        whole.extend(organs[0].get(key).map(|quantity| (key.to_owned(), *quantity)));
    }
    // Organs that share a node have the same internode below; it is counted once.
    let mut on_main: Vec<(f64, f64)> = plant
        .organs
        .iter()
        .zip(organs)
        .filter(|(o, _)| o.parent == Some(0))
        .filter_map(|(o, t)| Some((o.joint.d, t.get(keys::INTERNODE_LENGTH)?.value)))
        .collect();
    on_main.sort_by(|a, b| a.0.total_cmp(&b.0));
    on_main.dedup_by(|b, a| branching::share_a_node(a.0, b.0));
    if let Some(mean) = mean(on_main.iter().map(|node| node.1)) {
        put(&mut whole, keys::INTERNODE_LENGTH, mean, Unit::Metre);
    }
    whole
}

fn put(traits: &mut Traits, key: &str, value: f64, unit: Unit) {
    traits.insert(key.to_owned(), Quantity { value, unit, sigma: None });
}
