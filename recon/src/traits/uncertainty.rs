//! What a fit knows of traits and a record does not: how sure they are, and what was seen.

use std::collections::BTreeMap;

use super::{PlantTraits, Quantity, Traits, Unit, keys, put};
use crate::fit::OrganFit;

/// Least share of a blade's surface that is seen for the blade to count as visible (a guess).
pub const VISIBLE: f64 = 0.5;

/// A trait's standard uncertainty in two parts, which add as squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigma {
    /// What the data leave open, in the trait's unit.
    pub data: f64,
    /// What the model is off by: radians for angles, a share of the value for all else.
    pub model: f64,
}

/// Uncertainties by the trait's key.
pub type Sigmas = BTreeMap<&'static str, Sigma>;

impl Sigma {
    /// The standard uncertainty of a value.
    fn of(self, quantity: &Quantity) -> f64 {
        let unit = if quantity.unit == Unit::Radian { 1.0 } else { quantity.value.abs() };
        self.data.hypot(self.model * unit)
    }
}

impl PlantTraits {
    /// Takes up what the fit of the same plant knows, one entry an organ.
    pub fn take_up(&mut self, fits: &[OrganFit]) {
        for (traits, fit) in self.organs.iter_mut().zip(fits) {
            for (key, sigma) in &fit.sigmas {
                if let Some(quantity) = traits.get_mut(*key) {
                    quantity.sigma = Some(sigma.of(quantity));
                }
            }
        }
        let seen = fits.iter().filter(|fit| fit.visible_fraction.is_some_and(|share| share >= VISIBLE)).count();
        put(&mut self.plant, keys::BLADE_COUNT_VISIBLE, seen as f64, Unit::One);
        for key in [keys::LEAF_AREA, keys::LEAF_LENGTH, keys::LEAF_WIDTH, keys::LEAF_INCLINATION] {
            let areas = self.organs.iter().map(|traits| Some(traits.get(keys::LEAF_AREA)?.value));
            let blades: Vec<&Traits> = self.organs.iter().filter(|traits| traits.contains_key(key)).collect();
            // The plant's area is a sum, its lengths are means and its inclination is weighted by area.
            let weights: Vec<f64> = match key {
                keys::LEAF_AREA => vec![1.0; blades.len()],
                keys::LEAF_INCLINATION => {
                    let total: f64 = areas.clone().flatten().sum();
                    areas.flatten().map(|area| area / total).collect()
                }
                _ => vec![1.0 / blades.len() as f64; blades.len()],
            };
            // Blades err each for itself, so their variances add; one that is not known leaves the whole unknown.
            let variance = blades.iter().zip(&weights).map(|(traits, w)| Some((traits[key].sigma? * w).powi(2)));
            let variance = variance.sum::<Option<f64>>().filter(|_| weights.len() == blades.len());
            if let (Some(quantity), Some(variance)) = (self.plant.get_mut(key), variance) {
                quantity.sigma = Some(variance.sqrt());
            }
        }
    }
}
