//! Moving parameters of one organ, of a kind of organ or of all.

use std::str::FromStr;

use super::{EditError, MAX_SIGMA, ParseError};
use crate::model::{Form, Organ, OrganKind, Plant, Species};

/// Which organs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Every organ that has the parameter.
    All,
    /// Stems, the main one too.
    Stems,
    /// Blades.
    Leaves,
    /// One organ.
    Organ(usize),
}

/// Which parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// Shape coefficient of a blade, from 0, in σ.
    Beta(usize),
    /// Deformation coefficient, from 0, in σ.
    Gamma(usize),
    /// Size relative to the parent; of the main stem, metres.
    Scale,
    /// Attachment on the parent, 0..=1.
    D,
    /// Radius of a stem in its path lengths.
    Radius,
    /// Cross-vein scaling of a blade.
    Width,
}

/// What becomes of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// This value.
    Set(f64),
    /// So much more.
    Add(f64),
    /// So many times as much.
    Times(f64),
}

/// One change of one parameter of some organs; as text `leaves:gamma.2+=0.5`, `7:d=0.3`, `stems:scale*=1.2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Of which organs.
    pub of: Selection,
    /// Which parameter.
    pub what: What,
    /// How.
    pub change: Change,
}

impl Selection {
    fn has(self, index: usize, organ: &Organ) -> bool {
        match self {
            Self::All => true,
            Self::Stems => organ.kind() != OrganKind::Leaf,
            Self::Leaves => organ.kind() == OrganKind::Leaf,
            Self::Organ(wanted) => wanted == index,
        }
    }

    /// Refuses an organ that is not there.
    fn check(self, plant: &Plant) -> Result<(), EditError> {
        match self {
            Self::Organ(found) if found >= plant.organs.len() => {
                Err(EditError::NoOrgan { expected: plant.organs.len(), found })
            }
            _ => Ok(()),
        }
    }
}

impl Change {
    fn of(self, before: f64) -> f64 {
        match self {
            Self::Set(value) => value,
            Self::Add(value) => before + value,
            Self::Times(value) => before * value,
        }
    }
}

impl Move {
    /// The plant with the move made. With [`Selection::All`], organs without the parameter stay as they are.
    ///
    /// # Errors
    /// [`EditError`] naming the organ: it is not there, has no such parameter, or would leave the model.
    pub fn apply(&self, plant: &Plant, species: &Species) -> Result<Plant, EditError> {
        self.of.check(plant)?;
        let mut after = plant.clone();
        for (index, organ) in after.organs.iter_mut().enumerate() {
            if !self.of.has(index, organ) {
                continue;
            }
            match self.move_one(index, organ, species) {
                Err(EditError::NoSuch { .. }) if self.of == Selection::All => {}
                other => other?,
            }
        }
        after.validate()?;
        Ok(after)
    }

    fn move_one(&self, index: usize, organ: &mut Organ, species: &Species) -> Result<(), EditError> {
        let none = |expected, found| Err(EditError::NoSuch { organ: index, expected, found });
        let (main, joint) = (organ.kind() == OrganKind::MainStem, &mut organ.joint);
        let number = match (self.what, &mut organ.form) {
            (What::Scale, _) => &mut joint.scale,
            (What::D, _) if main => return none("an organ with a parent", "main stem"),
            (What::D, _) => &mut joint.d,
            (What::Radius, Form::Stem { radius, .. }) => radius,
            (What::Width, Form::Leaf { blade, .. }) => &mut blade.width,
            (What::Beta(k), Form::Leaf { blade, .. }) => {
                return self.coefficient(index, "beta", k, species.leaf.shape.rank(), &mut blade.beta);
            }
            (What::Gamma(k), Form::Leaf { blade, .. }) => {
                return self.coefficient(index, "gamma", k, species.leaf.deform.rank(), &mut blade.gamma);
            }
            (What::Gamma(k), Form::Stem { gamma, .. }) => {
                return self.coefficient(index, "gamma", k, species.stem.deform.rank(), gamma);
            }
            (What::Radius, Form::Leaf { .. }) => return none("a stem", "leaf"),
            (What::Beta(_) | What::Width, Form::Stem { .. }) => return none("a leaf", "stem"),
        };
        *number = self.change.of(*number);
        Ok(())
    }

    fn coefficient(
        &self,
        organ: usize,
        what: &'static str,
        index: usize,
        rank: usize,
        coefficients: &mut Vec<f64>,
    ) -> Result<(), EditError> {
        if index >= rank {
            return Err(EditError::NoComponent { organ, what, expected: rank, found: index });
        }
        if coefficients.len() <= index {
            coefficients.resize(index + 1, 0.0);
        }
        coefficients[index] = within(organ, what, index, self.change.of(coefficients[index]))?;
        Ok(())
    }
}

/// Bends stems `factor` times as much as they are bent: 0 makes them as straight as the species can, 1 leaves them.
///
/// # Errors
/// [`EditError`] when the factor is not finite, a stem would leave the model, or the organ is a leaf.
pub fn bend(plant: &Plant, species: &Species, of: Selection, factor: f64) -> Result<Plant, EditError> {
    of.check(plant)?;
    if !factor.is_finite() {
        return Err(EditError::Number { what: "bend", expected: "a finite factor", found: factor });
    }
    let basis = &species.stem.deform;
    // The γ that is nearest to no angle at all.
    let straight = basis.project(&(basis.mean() * 0.0));
    let mut after = plant.clone();
    for (index, organ) in after.organs.iter_mut().enumerate().filter(|(index, organ)| of.has(*index, organ)) {
        match &mut organ.form {
            Form::Stem { gamma, .. } => {
                // The angles are scaled, not γ: where the mean stem is bent, γ = 0 is not straight.
                let straight = straight.iter().enumerate();
                let bent = straight.map(|(k, s)| (k, s + factor * (gamma.get(k).copied().unwrap_or(0.0) - s)));
                *gamma = bent.map(|(k, c)| within(index, "gamma", k, c)).collect::<Result<_, _>>()?;
            }
            Form::Leaf { .. } if matches!(of, Selection::Organ(_) | Selection::Leaves) => {
                return Err(EditError::NoSuch { organ: index, expected: "a stem", found: "leaf" });
            }
            Form::Leaf { .. } => {}
        }
    }
    after.validate()?;
    Ok(after)
}

fn within(organ: usize, what: &'static str, index: usize, found: f64) -> Result<f64, EditError> {
    // Rounding may carry a coefficient that stands on the bound over it.
    if found.abs() <= MAX_SIGMA + 1e-9 { Ok(found) } else { Err(EditError::Outside { organ, what, index, found }) }
}

impl FromStr for Selection {
    type Err = ParseError;

    fn from_str(text: &str) -> Result<Self, ParseError> {
        Ok(match text {
            "all" => Self::All,
            "stems" => Self::Stems,
            "leaves" => Self::Leaves,
            other => Self::Organ(parse(other, "all, stems, leaves or an organ's number")?),
        })
    }
}

impl FromStr for What {
    type Err = ParseError;

    fn from_str(text: &str) -> Result<Self, ParseError> {
        let expected = "beta.N, gamma.N, scale, d, radius or width";
        Ok(match (text, text.split_once('.')) {
            ("scale", _) => Self::Scale,
            ("d", _) => Self::D,
            ("radius", _) => Self::Radius,
            ("width", _) => Self::Width,
            (_, Some(("beta", index))) => Self::Beta(parse(index, expected)?),
            (_, Some(("gamma", index))) => Self::Gamma(parse(index, expected)?),
            _ => return Err(ParseError { expected, found: text.into() }),
        })
    }
}

impl FromStr for Move {
    type Err = ParseError;

    fn from_str(text: &str) -> Result<Self, ParseError> {
        let expected = "ORGANS:WHAT=NUMBER (or +=, -=, *=), such as leaves:gamma.2+=0.5";
        let malformed = || ParseError { expected, found: text.into() };
        let (left, number) = text.split_once('=').ok_or_else(malformed)?;
        let (of, what) = left.split_once(':').ok_or_else(malformed)?;
        let number: f64 = parse(number, "a number")?;
        if !number.is_finite() {
            return Err(ParseError { expected: "a finite number", found: text.into() });
        }
        let (what, change) = match what.char_indices().last() {
            Some((at, '+')) => (&what[..at], Change::Add(number)),
            Some((at, '-')) => (&what[..at], Change::Add(-number)),
            Some((at, '*')) => (&what[..at], Change::Times(number)),
            _ => (what, Change::Set(number)),
        };
        Ok(Self { of: of.parse()?, what: what.parse()?, change })
    }
}

fn parse<T: FromStr>(text: &str, expected: &'static str) -> Result<T, ParseError> {
    text.trim().parse().ok().ok_or_else(|| ParseError { expected, found: text.into() })
}
