//! The synthetic world: plants, scenes and pictures of them with exact truth, all from seeds.
//!
//! [`grow`] makes a plant in the parameters of the Demeter model; [`Scene`] stands plants on ground before a backdrop
//! under a light; [`render`] takes their picture with depth, semantics and instances; [`row`], [`lab`] and
//! [`training_view`] put whole settings together. The same seed gives the same bytes.

mod boundary;
mod grow;
mod labelled;
mod maize;
pub(crate) mod raster;
mod render;
mod row;
mod scene;
mod sensor;
mod shade;
mod soybean;
mod sprout;
mod surface;
mod texture;
mod training;
mod truth;

pub use boundary::boundary_distance;
pub use grow::grow;
pub use labelled::{LabelledCloud, labelled_cloud};
pub use render::{OrganRef, View, render};
pub use row::{Lab, Row, lab, row};
pub use scene::{Backdrop, Ground, Light, Pot, Scene, Setting, Standing, WorldError};
pub use sensor::Sensor;
pub(crate) use sprout::normal;
pub use surface::Surface;
pub use training::training_view;
pub use truth::{OrganTruth, PlantTruth, truth};

/// The world's generator: its stream is specified, so a seed means the same plant on every machine and version.
pub type Seeded = rand_chacha::ChaCha8Rng;

/// A generator from a seed.
#[must_use]
pub fn seeded(seed: u64) -> Seeded {
    rand::SeedableRng::seed_from_u64(seed)
}
