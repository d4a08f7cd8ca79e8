//! The daemon and the command line of Demeter Field: pipeline, store, status page.
//!
//! Start with [`cli`] for the commands and [`report`] for what they print.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod api;
pub mod cli;
pub mod commands;
pub mod config;
pub mod describe;
pub mod error;
pub mod eye;
pub mod files;
pub mod lens;
pub mod mesh_file;
pub mod output;
pub mod picture;
pub mod pipeline;
pub mod reconstruct;
pub mod report;
pub mod store;
pub mod studio;
pub mod synthetic;
pub mod worker;
