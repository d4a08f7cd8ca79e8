use object_store::path::{Path, PathPart};

use super::pass::PassError;
use crate::store::{Batch, Reader, Store, WholePlant};
use crate::tables;

/// Most plants and organs in one pair of tables: their files stay below about a megabyte (a plant takes about 1 KB, an
/// organ 0.1 KB), which is what a cut costs.
pub(crate) const PLANTS_A_TABLE: usize = 256;
const ORGANS: usize = 4096;

/// Packs the oldest plants that are in no batch, as far as they share rig and date, and keeps their tables. The batch's
/// number, `None` when all are packed.
pub(super) fn pack(store: &Store, reader: &Reader, limit: usize) -> Result<Option<i64>, PassError> {
    let mut plants = reader.whole(&reader.unpacked(limit)?)?;
    let Some(partition) = plants.first().map(partition) else { return Ok(None) };
    let mut organs = 0;
    plants.retain(|plant| {
        let fits = self::partition(plant) == partition && (organs == 0 || organs + plant.report.organs.len() <= ORGANS);
        organs += if fits { plant.report.organs.len() } else { 0 };
        fits
    });
    let key = |table: &str, bytes: &[u8]| {
        let parts = [table.into(), partition[0].clone(), partition[1].clone()];
        let file = PathPart::from(format!("{}.parquet", tables::hash(bytes)));
        Path::from_iter(parts.into_iter().chain([file])).to_string()
    };
    let (table, of_organs) = (tables::plants(&plants)?, tables::organs(&plants)?);
    let batch = Batch {
        plants_key: key("plants", &table),
        plants: table,
        organs_key: key("organs", &of_organs),
        organs: of_organs,
    };
    let seqs: Vec<_> = plants.iter().map(|plant| plant.row.seq).collect();
    Ok(Some(store.save_batch(&seqs, &batch)?))
}

/// Where a plant's rows go: its rig and the day it was seen on, UTC.
fn partition(plant: &WholePlant) -> [PathPart<'static>; 2] {
    // The store takes any text as a time, readers of the bucket must not stumble over it.
    let day = plant.row.time.parse::<jiff::Timestamp>().ok();
    let day = day.map_or_else(|| "unknown".into(), |time| time.strftime("%Y-%m-%d").to_string());
    [PathPart::from(format!("rig={}", plant.rig)), PathPart::from(format!("date={day}"))]
}
