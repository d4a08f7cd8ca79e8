//! Learning a species: leaf outlines to grids, clouds of organs to joint angles, both to bases.

mod adapt;
mod deform;
mod displacement;
mod joints;
mod lesson;
mod mirror;
mod pca;
mod reach;
mod smooth;

pub use adapt::{adapted, rich_in_shape};
pub use deform::{Components, LearnError, Taught, rich};
pub use joints::Hanging;
pub use lesson::{Lesson, LessonError, Reason, Refused};
pub use pca::{Pca, PcaError, Prior, folds};
pub use reach::{Reach, reach};
