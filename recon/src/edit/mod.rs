//! Changing plants: move a coefficient, bend stems, cut, graft, go from one plant towards another.
//!
//! Every edit takes a valid plant and gives a valid one or a typed error; coefficients that an edit changes must stay
//! within [`MAX_SIGMA`] or the edit is refused, because a user who asks for 5 σ should hear that no such plant was
//! seen rather than get another one. Organs keep their indices unless some are cut.

mod between;
mod change;
mod error;
mod tree;

pub use between::between;
pub use change::{Change, Move, Selection, What, bend};
pub use error::{EditError, ParseError};
pub use tree::{cut, graft};

/// Largest coefficient that an edit may leave, standard deviations: that of the fits (spec/reconstruction.md).
pub const MAX_SIGMA: f64 = 3.0;
