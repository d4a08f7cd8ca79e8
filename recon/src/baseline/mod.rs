//! What the model is measured against (spec/reconstruction.md "Tables to reproduce"): a procedural plant of eight
//! numbers, and loose surfaces without any plant. Used by the evaluation alone.

mod grammar;
mod patch;
mod search;
mod simple_proc;

pub use patch::{bezier, quadratic};
pub use simple_proc::{PARAMETERS, simple_proc};
