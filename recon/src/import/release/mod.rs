//! The authors' public release, read from bytes: bases (.pth) and fitted plants (graph.pkl with info/).
//!
//! Oracle and interchange only: the release's licence is academic and non-commercial, so nothing made from it ships.
//! What its files mean was measured on them and on the vertices that come with them; PARITY.md has the list.

mod archive;
mod bases;
mod decode;
mod error;
mod pickle;
mod plant;
mod raw;
mod species;
#[cfg(test)]
mod tests;

pub use bases::{Bases, FILES};
pub use error::ReleaseError;
pub use pickle::PickleError;
pub use plant::{PLANT_FILES, ReleaseForm, ReleaseOrgan, ReleasePlant};
pub use raw::{RawForm, RawOrgan, RawPlant};
pub use species::{PROVENANCE, SpeciesImportError};
