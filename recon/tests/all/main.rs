//! Every integration test of recon in one program: one link instead of eighteen.
#![allow(clippy::unwrap_used)]

mod blades;
mod chamfer;
mod clouds;
mod common;
mod curves;
mod edits;
mod fit_truth;
mod hostile_clouds;
mod laws;
mod leaf_shape;
mod leaflets;
mod learn;
mod left_out;
mod meshes;
mod odd_blades;
mod predicted;
mod records;
mod segmenting;
mod traits;
mod view;
