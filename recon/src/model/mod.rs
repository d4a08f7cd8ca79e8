//! The Demeter plant model: topology, articulation, shape and deformation, and their surface.
//!
//! Equations and sections are those of the paper (ICCV 2025); conventions where it is silent are ours and are listed
//! in PARITY.md. Read [`plant`] for the parameters, [`kinematics`] for what they mean, [`leaf`] and [`stem`] for the
//! organs, [`mesh`] for the surface.

mod basis;
mod catmull_rom;
mod chain;
mod inverse;
pub mod kinematics;
pub mod leaf;
pub mod mesh;
pub mod plant;
mod priors;
pub mod species;
pub mod stem;

pub use basis::{Basis, BasisError};
pub use catmull_rom::{Knots, refine};
pub use inverse::{leaf_angles, stem_angles};
pub use kinematics::{PosedPlant, Shape, Similarity, articulate, forward};
pub use mesh::{Detail, PlantMesh};
pub use plant::{Form, Joint, Organ, OrganKind, Plant, PlantError};
pub use priors::{JointPrior, Normal, Priors};
pub use species::{Habit, Range, Ranges, Species};
