//! The daemon and the command line of Demeter Field: pipeline, store, status page.
//!
//! Start with [`cli`] for the commands and [`report`] for what they print.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod api;
pub mod board;
pub mod cli;
pub mod clock;
pub mod commands;
pub mod config;
mod cutter;
pub mod daemon;
pub mod describe;
pub mod divider;
pub mod error;
pub mod eye;
mod far;
pub mod files;
pub mod lens;
pub mod mesh_file;
mod networks;
pub mod output;
pub mod picture;
pub mod pipeline;
pub mod portrait;
mod raster;
pub mod reconstruct;
pub mod report;
pub mod status;
pub mod store;
pub mod studio;
pub mod sync;
pub mod synthetic;
pub mod tables;
