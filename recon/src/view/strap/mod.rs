//! Grasses seen from the side: silhouette to middle lines, to a stem and blades, to organs in space.

mod network;
mod raise;
mod silhouette;
mod trace;

pub use raise::{Raised, SideView};
pub use silhouette::Silhouette;
pub use trace::{Sketch, Stroke};
