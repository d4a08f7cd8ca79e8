use super::MAX_SIGMA;
use crate::model::PlantError;

/// Why an edit is refused.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum EditError {
    /// An organ that the plant does not have.
    #[error("expected an organ below {expected}, found {found}")]
    NoOrgan {
        /// Organs of the plant.
        expected: usize,
        /// The organ asked for.
        found: usize,
    },
    /// A parameter that the organ does not have.
    #[error("organ {organ}: expected {expected}, found a {found}")]
    NoSuch {
        /// The organ.
        organ: usize,
        /// What the edit needs.
        expected: &'static str,
        /// What the organ is.
        found: &'static str,
    },
    /// A coefficient that would leave the model.
    #[error("organ {organ}: expected {what}.{index} within {MAX_SIGMA} standard deviations, found {found}")]
    Outside {
        /// The organ.
        organ: usize,
        /// `beta` or `gamma`.
        what: &'static str,
        /// Which coefficient, from 0.
        index: usize,
        /// What it would become.
        found: f64,
    },
    /// A coefficient beyond the species' components.
    #[error("organ {organ}: expected {what} below {expected}, found {what}.{found}")]
    NoComponent {
        /// The organ.
        organ: usize,
        /// `beta` or `gamma`.
        what: &'static str,
        /// Components there are.
        expected: usize,
        /// The one asked for.
        found: usize,
    },
    /// Plants that are not built alike.
    #[error("organ {organ}: expected the same {what} in both plants, found {first} and {second}")]
    Topology {
        /// The first organ that differs.
        organ: usize,
        /// What differs.
        what: &'static str,
        /// In the first plant.
        first: String,
        /// In the second.
        second: String,
    },
    /// A number outside its meaning.
    #[error("{what}: expected {expected}, found {found}")]
    Number {
        /// Which number.
        what: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: f64,
    },
    /// The result is no plant.
    #[error(transparent)]
    Plant(#[from] PlantError),
}

/// Why a text is no [`super::Move`].
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("expected {expected}, found `{found}`")]
pub struct ParseError {
    /// What should stand there.
    pub expected: &'static str,
    /// What does.
    pub found: String,
}
