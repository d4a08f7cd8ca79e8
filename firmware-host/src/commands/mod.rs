//! One file a command: its arguments and what it does with them.

pub mod doctor;
pub mod plants;
pub mod run;
pub mod synth;
