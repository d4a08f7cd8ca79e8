//! What is handed to the store.

use glam::DVec3;
use serde::Serialize;

use super::StoreError;
use crate::report::PlantReport;

/// A recording that plants come from.
#[derive(Clone, Debug, PartialEq)]
pub struct NewSession {
    /// Its id.
    pub id: String,
    /// The rig that it was recorded with.
    pub rig: String,
    /// Id and calibration (JSON) of each camera.
    pub cameras: Vec<(String, serde_json::Value)>,
}

/// A plant as the pipeline hands it over. Nothing here is a measured time: the same frames give the same body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NewPlant {
    /// Id, species, organs, traits, CD, scale: what the commands report. Id and species hash are needed.
    pub report: PlantReport,
    /// The compact record.
    #[serde(skip)]
    pub record: Vec<u8>,
    /// The session it was seen in, saved before.
    pub session: String,
    /// Wall time of the frame that the plant is dated by, RFC 3339 UTC.
    pub time: String,
    /// The clock was synchronised then.
    pub time_trusted: bool,
    /// The main stem's base in the session's world, metres.
    pub position: Option<DVec3>,
    /// Latitude and longitude in WGS 84 degrees.
    pub geographic: Option<[f64; 2]>,
    /// SHA-256 of each network used, saved before.
    pub models: Vec<String>,
    /// Program version and settings that the plant depends on.
    pub provenance: serde_json::Value,
    /// Camera and sequence of each frame that saw it.
    pub observations: Vec<(String, u64)>,
    /// PNG: the photo's crop beside the fitted plant.
    #[serde(skip)]
    pub thumbnail: Option<Vec<u8>>,
}

impl NewPlant {
    /// BLAKE3 of everything saved.
    pub(super) fn body(&self) -> Result<blake3::Hash, serde_json::Error> {
        let mut hasher = blake3::Hasher::new();
        for part in [&serde_json::to_vec(self)?, &self.record, self.thumbnail.as_ref().unwrap_or(&vec![])] {
            // With the lengths, bytes cannot move from one part to the next unseen.
            hasher.update(&(part.len() as u64).to_le_bytes()).update(part);
        }
        Ok(hasher.finalize())
    }

    /// The id, after checking what SQLite would store as NULL or JSON as null.
    pub(super) fn checked(&self) -> Result<&str, StoreError> {
        let id = self.report.id.as_deref().unwrap_or_default();
        let bad = |key: &str, expected, found: String| {
            Err(StoreError::Value { id: id.to_owned(), key: key.to_owned(), expected, found })
        };
        if id.is_empty() || id.len() > 200 || !id.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)) {
            return bad("id", "1 to 200 letters, digits, `-`, `_` or `.`", format!("`{id}`"));
        }
        if self.report.bytes != self.record.len() {
            return bad("bytes", "the record's length", self.report.bytes.to_string());
        }
        let organs = self.report.organs.iter();
        let traits = self.report.traits.iter().chain(organs.clone().flat_map(|organ| &organ.traits));
        let quantities = traits.flat_map(|(key, q)| [(key.as_str(), Some(q.value)), (key.as_str(), q.sigma)]);
        let fits = organs.flat_map(|o| [("residual", o.residual), ("visible_fraction", o.visible_fraction)]);
        let position =
            self.position.map(|p| p.to_array()).into_iter().flatten().chain(self.geographic.into_iter().flatten());
        let numbers = quantities.chain(fits).chain([("cd", self.report.cd)]);
        match numbers.chain(position.map(|x| ("position", Some(x)))).find(|(_, x)| x.is_some_and(|x| !x.is_finite())) {
            Some((key, found)) => bad(key, "finite", format!("{found:?}")),
            None => Ok(id),
        }
    }
}
