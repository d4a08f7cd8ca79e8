//! How a species' organs usually hang on each other: priors of the articulation θ (paper 3.2).

use serde::{Deserialize, Serialize};

/// A normal distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normal {
    /// Mean, in the unit of the quantity.
    pub mean: f64,
    /// Standard deviation, in the same unit.
    pub sd: f64,
}

impl Normal {
    /// A distribution so wide that it says nothing about ratios, angles or fractions.
    pub const UNKNOWN: Self = Self { mean: 0.0, sd: 1e3 };

    /// Mean and standard deviation of values, to four decimals, which JSON keeps exactly; too few to tell (under 3, or
    /// all equal) give [`Self::UNKNOWN`].
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let sd = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let [mean, sd] = [mean, sd].map(|x| (x * 1e4).round() / 1e4);
        if values.len() >= 3 && sd.is_finite() && sd > 0.0 { Self { mean, sd } } else { Self::UNKNOWN }
    }

    fn is_valid(&self) -> bool {
        self.mean.is_finite() && self.sd.is_finite() && self.sd > 0.0
    }
}

/// How one kind of organ hangs on its parent stem.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointPrior {
    /// ln of the organ's size relative to its parent's path length.
    pub ln_scale: Normal,
    /// Angle between the organ's chord and the parent's direction where it is attached, radians.
    pub inclination: Normal,
    /// Attachment d, fraction of the parent's path length.
    pub attachment: Normal,
}

/// Priors of articulation, thickness and width, learned from whole plants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Priors {
    /// Blades on stems.
    pub blade: JointPrior,
    /// Stems on stems: petioles, branches, petiolules.
    pub stem: JointPrior,
    /// ln of a stem's radius relative to its parent's, both in metres.
    pub ln_thickness: Normal,
    /// ln s_x of blades; only grasses vary.
    pub ln_width: Normal,
}

impl Priors {
    /// Nothing is known.
    pub const UNKNOWN: Self = {
        let joint = JointPrior { ln_scale: Normal::UNKNOWN, inclination: Normal::UNKNOWN, attachment: Normal::UNKNOWN };
        Self { blade: joint, stem: joint, ln_thickness: Normal::UNKNOWN, ln_width: Normal::UNKNOWN }
    };

    /// Every mean finite, every standard deviation finite and above 0.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let joints = [self.blade, self.stem].map(|j| [j.ln_scale, j.inclination, j.attachment]);
        joints.iter().flatten().chain([&self.ln_thickness, &self.ln_width]).all(Normal::is_valid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_values_and_too_few_values_say_nothing() {
        let found = Normal::of(&[1.0, 2.0, 3.0, 6.0]);
        assert!(found.mean == 3.0 && (found.sd - (14.0_f64 / 3.0).sqrt()).abs() < 1e-4, "{found:?}");
        for few in [&[][..], &[1.0], &[2.0, 2.5], &[1.0, 1.0, 1.0], &[f64::NAN, 1.0, 2.0]] {
            assert_eq!(Normal::of(few), Normal::UNKNOWN, "{few:?}");
        }
        assert!(Priors::UNKNOWN.is_valid());
        let mut wrong = Priors::UNKNOWN;
        wrong.stem.inclination.sd = 0.0;
        assert!(!wrong.is_valid());
    }
}
