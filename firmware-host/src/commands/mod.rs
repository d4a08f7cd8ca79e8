//! One file a command: its arguments and what it does with them.

pub mod camera;
pub mod compact;
pub mod decode;
pub mod doctor;
pub mod edit;
pub mod eval;
pub mod fit;
pub mod import;
pub mod learn;
pub mod models;
pub mod photo;
pub mod plants;
pub mod replay;
pub mod run;
pub mod species;
pub mod sync;
pub mod synth;
mod target;

/// Metres from plant to plant, as an argument.
pub(crate) fn spacing(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (0.01..=10.0).contains(&x) => Ok(x),
        _ => Err("expected metres from 0.01 to 10".into()),
    }
}
