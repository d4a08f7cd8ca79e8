use super::error::{Doing, StoreError};
use super::read::{PlantRow, ROW, Reader, plant_row};
use crate::report::PlantReport;

/// A plant with all that the store knows of it, as it goes into tables.
#[derive(Clone, Debug, PartialEq)]
pub struct WholePlant {
    /// Its line in lists.
    pub row: PlantRow,
    /// Its traits and organs.
    pub report: PlantReport,
    /// The rig of its session.
    pub rig: String,
    /// The compact record.
    pub record: Vec<u8>,
    /// JSON: program version, networks and settings.
    pub provenance: String,
    /// JSON: camera and sequence of each frame that saw it.
    pub frames: String,
    /// JSON: calibration of each camera of its session.
    pub cameras: String,
    /// PNG: the photo's crop beside the fitted plant.
    pub thumbnail: Option<Vec<u8>>,
}

impl Reader {
    /// Whole plants of these sequence numbers, in their order.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn whole(&self, seqs: &[i64]) -> Result<Vec<WholePlant>, StoreError> {
        let sql = format!("{ROW} WHERE p.seq = ?1");
        let mut statement = self.connection.prepare_cached(&sql).doing("reading plants")?;
        let row = |seq: &i64| statement.query_row([seq], plant_row).doing("reading plants");
        let rows = seqs.iter().map(row).collect::<Result<Vec<_>, _>>()?;
        rows.into_iter().map(|row| self.complete(row)).collect()
    }

    fn complete(&self, row: PlantRow) -> Result<WholePlant, StoreError> {
        let missing = rusqlite::Error::QueryReturnedNoRows;
        let report = self.plant(&row.id)?.ok_or(missing).doing("reading a plant")?;
        let sql = "SELECT s.rig, p.record, p.provenance, p.thumbnail,
            (SELECT json_group_array(json_array(camera, frame) ORDER BY camera, frame)
                FROM observations WHERE plant = p.seq),
            (SELECT json_group_object(id, json(calibration) ORDER BY id) FROM cameras WHERE session = p.session)
            FROM plants p JOIN sessions s ON s.id = p.session WHERE p.seq = ?1";
        let whole = self.connection.prepare_cached(sql).doing("reading a plant")?.query_row([row.seq], |found| {
            Ok(WholePlant {
                rig: found.get(0)?,
                record: found.get(1)?,
                provenance: found.get(2)?,
                thumbnail: found.get(3)?,
                frames: found.get(4)?,
                cameras: found.get(5)?,
                row,
                report,
            })
        });
        whole.doing("reading a plant")
    }
}
