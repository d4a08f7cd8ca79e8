//! The Demeter plant model and everything geometric.
//!
//! Pure functions: no I/O, clock, threads or logging, and nothing that leaves a hash map unsorted, so the same input
//! gives the same bytes everywhere. Start with [`model::plant`].

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod axes;
pub mod baseline;
pub mod calibrate;
pub mod cloud;
mod distance;
pub mod edit;
pub mod export;
pub mod fit;
pub mod graph;
pub mod import;
pub mod learn;
pub mod metrics;
pub mod model;
pub mod nearest;
pub mod organs;
mod polyline;
pub mod pyramid;
pub mod record;
pub mod segment;
pub mod species;
pub mod statistics;
pub mod traits;
pub mod tree;
pub mod view;
pub mod world;
