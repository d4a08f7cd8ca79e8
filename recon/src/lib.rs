//! The Demeter plant model and everything geometric.
//!
//! Pure functions: no I/O, clock, threads or logging, and nothing that leaves a hash map unsorted, so the same input
//! gives the same bytes everywhere. Start with [`model::plant`].

pub mod cloud;
pub mod fit;
pub mod graph;
pub mod metrics;
pub mod model;
pub mod nearest;
pub mod organs;
pub mod segment;
pub mod species;
pub mod tree;
