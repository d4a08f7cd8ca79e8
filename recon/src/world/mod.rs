//! The synthetic world: plants, scenes and pictures of them with exact truth, all from seeds.
//!
//! [`grow`] makes a plant in the parameters of the Demeter model; [`Scene`] stands plants on ground before a backdrop
//! under a light; [`render`] takes their picture with depth, semantics and instances. [`LabelledMesh`] lets plants of
//! other generators stand in a scene, cut out of [`Texture`]s; [`row`] puts a row together, and [`training_view`], out of a
//! [`Nursery`], whatever a network should have seen. The same seed gives the same bytes.

mod backdrop;
mod boundary;
mod grow;
mod labelled;
mod look;
mod maize;
mod mesh;
mod noise;
mod nursery;
mod plot;
mod portrait;
mod pot;
pub(crate) mod raster;
mod render;
mod ripple;
mod row;
mod scene;
mod sensor;
mod shade;
mod shadow;
mod soybean;
mod sprout;
mod surface;
mod texture;
mod training;
mod truth;
mod weather;

pub use backdrop::Backdrop;
pub use boundary::boundary_distance;
pub use grow::grow;
pub use labelled::{LabelledCloud, labelled_cloud};
pub use mesh::{LabelledMesh, MeshError, MeshOrgan, StandingMesh};
pub use nursery::Nursery;
pub use pot::Pot;
pub use render::{OrganRef, View, render};
pub use row::{Row, row};
pub use scene::{Ground, Scene, Setting, Standing, WorldError};
pub use sensor::{Flare, Sensor};
pub(crate) use sprout::normal;
pub use surface::Surface;
pub use texture::Texture;
pub use training::training_view;
pub use truth::{OrganTruth, PlantTruth, truth};
pub use weather::{Light, Shade};

/// The world's generator: its stream is specified, so a seed means the same plant on every machine and version.
pub type Seeded = rand_chacha::ChaCha8Rng;

/// A generator from a seed.
#[must_use]
pub fn seeded(seed: u64) -> Seeded {
    rand::SeedableRng::seed_from_u64(seed)
}
