//! Learning a species from scans: leaf outlines to grids, grids to bases.

mod pca;

pub use pca::{Pca, PcaError, Prior, folds};
