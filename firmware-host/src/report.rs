//! What commands say of plants: plant.schema.json as types, and the same as a table.

use std::fmt::Write;

use demeter_frame::{Intrinsics, Pose};
use demeter_recon::model::OrganKind;
use demeter_recon::organs::ScaleSource;
use demeter_recon::traits::Traits;
use serde::{Deserialize, Serialize};

use crate::error::CommandError;

/// A successful answer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// The plants, in the order they were found.
    pub plants: Vec<PlantReport>,
    /// What the user should know about the whole run.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Time the command took, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
}

/// An unsuccessful answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorDocument {
    error: ErrorReport,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct ErrorReport {
    kind: &'static str,
    message: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    expected: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    found: Option<String>,
}

impl From<&CommandError> for ErrorDocument {
    fn from(error: &CommandError) -> Self {
        let CommandError { kind, message, expected, found, .. } = error.clone();
        Self { error: ErrorReport { kind, message, expected, found } }
    }
}

/// One plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlantReport {
    /// Its id in the store.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Name of its species.
    pub species: String,
    /// Hash of the species file that its record needs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub species_hash: Option<String>,
    /// Its organs, parents before children.
    pub organs: Vec<OrganReport>,
    /// Traits of the whole plant by key.
    pub traits: Traits,
    /// Chamfer distance as spec/reconstruction.md defines it.
    pub cd: Option<f64>,
    /// Size of the compact record.
    pub bytes: usize,
    /// Where the metric scale comes from.
    pub scale_source: ScaleSource,
    /// Path of the record written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<String>,
    /// The camera in which a photo's plant was fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// What the user should know about this plant.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Time spent on this plant, milliseconds: for the table alone, the contract and the store have no place for it.
    #[serde(skip)]
    pub ms: Option<f64>,
}

/// One organ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrganReport {
    /// Its index in the record.
    pub id: usize,
    /// What it is.
    pub kind: Kind,
    /// Its parent, `None` for the main stem.
    pub parent: Option<usize>,
    /// Which leaf a blade belongs to.
    #[serde(default)]
    pub leaf: Option<u16>,
    /// Points that it was fitted to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<usize>,
    /// Mean distance of its points from its surface, metres.
    #[serde(default)]
    pub residual: Option<f64>,
    /// Share of it that was seen, 0..=1.
    #[serde(default)]
    pub visible_fraction: Option<f64>,
    /// Its traits by key.
    #[serde(default)]
    pub traits: Traits,
}

/// An organ's kind in the contract's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The stem that stands on the ground.
    MainStem,
    /// A branch, petiole, rachis or petiolule.
    Stem,
    /// A blade.
    Leaf,
}

impl From<OrganKind> for Kind {
    fn from(kind: OrganKind) -> Self {
        match kind {
            OrganKind::MainStem => Self::MainStem,
            OrganKind::Stem => Self::Stem,
            OrganKind::Leaf => Self::Leaf,
        }
    }
}

/// The pinhole camera of a photo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Size, focal length and centre.
    #[serde(flatten)]
    pub intrinsics: Intrinsics,
    /// Maps a mesh vertex into the camera's frame.
    pub camera_from_plant: Pose,
}

impl Document {
    /// The warnings of the run and, named, of every plant.
    pub fn all_warnings(&self) -> impl Iterator<Item = String> {
        let of_plant = |plant: &PlantReport| {
            let id = plant.id.clone().unwrap_or_else(|| "plant".into());
            plant.warnings.iter().map(move |warning| format!("{id}: {warning}")).collect::<Vec<_>>()
        };
        self.warnings.iter().cloned().chain(self.plants.iter().flat_map(of_plant))
    }
}

/// The plants as a table for people: lengths in centimetres, areas in square centimetres, `-` where nothing is known.
#[must_use]
pub fn table(plants: &[PlantReport], color: bool) -> String {
    let header = ["plant", "species", "leaves", "blades", "height cm", "leaf area cm2", "CD", "bytes", "ms"];
    let number = |value: Option<f64>, scale: f64, digits: usize| {
        value.map_or_else(|| "-".into(), |value| format!("{:.digits$}", value * scale))
    };
    let row = |plant: &PlantReport| {
        let value = |key: &str| plant.traits.get(key).map(|quantity| quantity.value);
        [
            plant.id.clone().unwrap_or_else(|| "-".into()),
            plant.species.clone(),
            number(value("leaf_count"), 1.0, 0),
            number(value("blade_count"), 1.0, 0),
            number(value("height"), 1e2, 1),
            number(value("leaf_area"), 1e4, 1),
            number(plant.cd, 1.0, 4),
            plant.bytes.to_string(),
            number(plant.ms, 1.0, 0),
        ]
    };
    columns(&header, &plants.iter().map(row).collect::<Vec<_>>(), color)
}

/// The contract's word for a plain enum.
#[must_use]
pub fn word(value: &impl Serialize) -> String {
    serde_json::json!(value).as_str().unwrap_or_default().to_owned()
}

/// Lines up cells: the first two columns to the left, the others to the right; the header bold on terminals.
#[must_use]
pub fn columns<const N: usize>(header: &[&str; N], rows: &[[String; N]], color: bool) -> String {
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).chain([header[i].len()]).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let line = |cells: [&str; N]| {
        let mut line = String::new();
        for (i, (cell, width)) in cells.into_iter().zip(widths).enumerate() {
            let gap = if i == 0 { "" } else { "  " };
            // Writing to a String cannot fail.
            if i < 2 { write!(line, "{gap}{cell:<width$}") } else { write!(line, "{gap}{cell:>width$}") }
                .unwrap_or_default();
        }
        line.trim_end().to_owned()
    };
    let head = line(*header);
    let mut text = if color { format!("\x1b[1m{head}\x1b[0m\n") } else { head + "\n" };
    for row in rows {
        text += &line(row.each_ref().map(String::as_str));
        text.push('\n');
    }
    text
}
