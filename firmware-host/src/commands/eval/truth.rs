//! The truth that tools/helios/grow.py writes beside each of its clouds.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::CommandError;
use crate::files;

/// A plant's truth; lengths in metres, angles in radians. Unknown fields are other readers'.
#[derive(Debug, Deserialize)]
pub(super) struct Truth {
    /// Its species; not every one of them ships with us.
    pub species: String,
    /// Standard deviation of the points' noise.
    pub noise_m: f64,
    /// Share of the points that went missing.
    pub missing: f64,
    /// Height above the ground.
    pub height: f64,
    /// Its organs; `id` is the index.
    pub organs: Vec<Organ>,
}

/// One organ's truth.
#[derive(Debug, Deserialize)]
pub(super) struct Organ {
    /// The cloud's property `organ`.
    pub id: i32,
    /// `main_stem`, `stem` or `blade`.
    pub kind: Kind,
    /// Its parent's id.
    pub parent: Option<i32>,
    /// Arc length on the parent where it is attached.
    pub attach: f64,
    /// Length along the midrib or the stem.
    pub length: f64,
    /// Its points in the cloud.
    pub points: usize,
    /// Share of its points that did not go missing.
    pub visible: f64,
    /// The cloud's property `label`, of blades.
    #[serde(default)]
    pub label: i32,
    /// One-sided area, of blades.
    #[serde(default)]
    pub area: f64,
    /// Angle of the mean normal to the vertical, of blades.
    #[serde(default)]
    pub inclination: f64,
}

/// What an organ is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    MainStem,
    Stem,
    Blade,
}

impl Truth {
    /// Reads the truth of `path` (.json) and says where its cloud is.
    pub(super) fn read(path: &Path) -> Result<(Self, PathBuf), CommandError> {
        let truth: Self = serde_json::from_slice(&files::read(path)?)
            .map_err(|error| CommandError::failed("truth", &error).of(path))?;
        for (id, organ) in truth.organs.iter().enumerate() {
            let known = organ.parent.is_none_or(|parent| truth.organs.get(parent as usize).is_some());
            if organ.id as usize != id || !known {
                let message = format!("{}: organ {id}: expected ids in order and known parents", path.display());
                return Err(CommandError::usage("truth", message));
            }
        }
        Ok((truth, path.with_extension("ply")))
    }

    /// What hangs on the main stem and carries this organ, or is it; `None` for the main stem and without an end.
    pub(super) fn on_main_stem(&self, mut organ: usize) -> Option<usize> {
        for _ in 0..self.organs.len() {
            match self.organs[organ].parent? {
                0 => return Some(organ),
                parent => organ = parent as usize,
            }
        }
        None
    }
}
