//! Learning a species: leaf outlines to grids, clouds of organs to joint angles, both to bases.

mod adapt;
mod contour;
mod deform;
mod displacement;
mod harmonic;
mod held_out;
mod joints;
mod lesson;
mod mask;
mod mirror;
mod outline;
mod oval;
mod pca;
mod quality;
mod reach;
pub mod shape;
mod smooth;
mod unfold;

pub use adapt::{adapted, rich_in_shape};
pub use deform::{Components, LearnError, Taught, rich};
pub use harmonic::harmonic;
pub use held_out::blade_errors;
pub use joints::Hanging;
pub use lesson::{Lesson, LessonError, Refusal, Refused};
pub use outline::{Ends, Outline, OutlineError, STEPS, Traced};
pub use oval::oval;
pub use pca::{Pca, PcaError, Prior, folds};
pub use quality::{Measure, Rejection, rejections};
pub use reach::{Reach, reach};
pub use unfold::folded;
