//! How well a result agrees with data or truth (spec/reconstruction.md "Metrics"): defined once, used everywhere.

mod agreement;
mod chamfer;
mod division;
mod parents;

pub use agreement::{Agreement, Pair};
pub use chamfer::{Chamfer, SURFACE_SAMPLES, chamfer, rough_chamfer, sample_surface};
pub use division::{Division, MIN_SEEN_POINTS, stems_merged};
pub use parents::{Parents, right_parents};
