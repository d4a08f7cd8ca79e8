//! `demeter compact`: the daily files of months that are over, merged into few.
//!
//! Merged files are sent first and read back, then the manifest that names them and what they hold. Until it is there
//! nobody looks at them, from then on nobody looks at the daily files in it: however often this is cut, readers see each
//! row once. Daily files stay, so that whoever reads just now loses nothing.

use std::collections::{BTreeMap, BTreeSet};

use jiff::civil::Date;
use parquet::errors::ParquetError;
use serde::Serialize;

use super::destination::{Destination, Object};
use super::error::SendError;
use super::manifest::{COMPACTED, Manifest, Merged, folder, key};
use crate::error::CommandError;
use crate::tables::{Merger, Table, hash};

/// Daily files are merged into one up to this many bytes together: a guess that fits the memory of a small box and is
/// large enough for queries over a bucket.
const MOST_BYTES: u64 = 32 << 20;

/// What a compaction did.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Compacted {
    /// Each month that is over and has daily files.
    pub months: Vec<Month>,
    /// Daily files that could not be read; readers still find them where they are.
    pub left_out: Vec<LeftOut>,
}

/// A month that is compacted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Month {
    /// What its manifest says.
    #[serde(flatten)]
    pub manifest: Manifest,
    /// The manifest was put just now; otherwise all of it was there.
    pub written: bool,
}

/// A daily file that is not what its key says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Its key.
    pub key: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Why a compaction ended before its time.
#[derive(Debug, thiserror::Error)]
pub enum CompactError {
    /// The server's fault.
    #[error(transparent)]
    Server(#[from] SendError),
    /// A merged file could not be written.
    #[error("compact: writing tables: {0}")]
    Tables(#[from] ParquetError),
}

impl From<CompactError> for CommandError {
    fn from(error: CompactError) -> Self {
        match error {
            CompactError::Server(error) => error.into(),
            CompactError::Tables(_) => Self::failed("compact", &error),
        }
    }
}

/// Daily files by month: of plants and of organs.
type Months = BTreeMap<String, [Vec<Object>; 2]>;

/// The folders of daily files, in the order of [`Months`].
const TABLES: [&str; 2] = ["plants", "organs"];

/// Compacts every month before the one of `today` (UTC) that has daily files which its manifest does not name.
///
/// # Errors
/// [`CompactError`] when the server fails; what was done until then stays and is right.
pub async fn compact(destination: &Destination, today: Date) -> Result<Compacted, CompactError> {
    let mut months = Months::new();
    for (i, table) in TABLES.into_iter().enumerate() {
        for object in destination.list(table).await? {
            if let Some(month) = month(&object.key).filter(|month| **month < *today.strftime("%Y-%m").to_string()) {
                months.entry(month.to_owned()).or_default()[i].push(object);
            }
        }
    }
    let there = destination.list(COMPACTED).await?;
    let mut done = Compacted::default();
    for (month, daily) in months {
        let before = manifest(destination, &there, &key(&month)).await?;
        if let Some(manifest) = before.clone().filter(|manifest| is_whole(manifest, &daily, &there)) {
            done.months.push(Month { manifest, written: false });
            continue;
        }
        let [plants, organs] = &daily;
        let (plants, organs) = (
            merge(destination, &folder(&month), TABLES[0], plants, &mut done.left_out).await?,
            merge(destination, &folder(&month), TABLES[1], organs, &mut done.left_out).await?,
        );
        let manifest = Manifest { month, plants, organs };
        let written = before.as_ref() != Some(&manifest);
        if written {
            // Strings and numbers always make JSON.
            let json = serde_json::to_vec_pretty(&manifest).unwrap_or_default();
            destination.send(&key(&manifest.month), &json).await?;
        }
        done.months.push(Month { manifest, written });
    }
    Ok(done)
}

/// The month of a daily file; plants whose day nobody knows stay where they are.
fn month(key: &str) -> Option<&str> {
    let date = key.split('/').find_map(|part| part.strip_prefix("date="))?;
    date.parse::<Date>().ok()?;
    key.ends_with(".parquet").then(|| date.rsplit_once('-'))?.map(|(month, _)| month)
}

/// The manifest as it is; one that nobody can read is made anew.
async fn manifest(destination: &Destination, there: &[Object], key: &str) -> Result<Option<Manifest>, SendError> {
    let Some(object) = there.iter().find(|object| object.key == key) else { return Ok(None) };
    let read = destination.read(key, object.size).await?;
    let read = read.and_then(|json| serde_json::from_slice(&json).map_err(|error| error.to_string()));
    Ok(read.inspect_err(|why| tracing::warn!("{key}: expected a manifest, found {why}; it is made anew")).ok())
}

/// Whether a manifest names all daily files, and all its own files are there.
fn is_whole(manifest: &Manifest, daily: &[Vec<Object>; 2], there: &[Object]) -> bool {
    let there: BTreeSet<_> = there.iter().map(|object| &object.key).collect();
    [&manifest.plants, &manifest.organs].into_iter().zip(daily).all(|(merged, daily)| {
        merged.files.iter().all(|file| there.contains(file))
            && merged.sources.iter().eq(daily.iter().map(|object| &object.key))
    })
}

/// Merges the daily files of one table, in the order of their keys.
async fn merge(
    destination: &Destination,
    folder: &str,
    table: &str,
    daily: &[Object],
    left_out: &mut Vec<LeftOut>,
) -> Result<Merged, CompactError> {
    let mut merged = Merged::default();
    let mut open: Option<(Merger, u64)> = None;
    for object in daily {
        let content = match destination.fetch(object).await {
            Ok(file) => Table::read(file).map_err(|error| error.to_string()),
            Err(error @ SendError::Differs { .. }) => Err(error.to_string()),
            Err(error) => return Err(error.into()),
        };
        let content = match content {
            Ok(content) => content,
            Err(reason) => {
                left_out.push(LeftOut { key: object.key.clone(), reason });
                continue;
            }
        };
        merged.sources.push(object.key.clone());
        let next = match open.take() {
            Some((mut merger, bytes)) if merger.takes(&content) && bytes + object.size <= MOST_BYTES => {
                merger.add(&content)?;
                (merger, bytes + object.size)
            }
            full => {
                close(destination, folder, table, full, &mut merged).await?;
                (Merger::new(&content)?, object.size)
            }
        };
        open = Some(next);
    }
    close(destination, folder, table, open, &mut merged).await?;
    Ok(merged)
}

/// Sends a merged file and reads it back.
async fn close(
    destination: &Destination,
    folder: &str,
    table: &str,
    open: Option<(Merger, u64)>,
    merged: &mut Merged,
) -> Result<(), CompactError> {
    let Some((merger, _)) = open else { return Ok(()) };
    let (file, rows) = merger.finish()?;
    let key = format!("{folder}/{table}/{}.parquet", hash(&file));
    destination.send(&key, &file).await?;
    merged.files.push(key);
    merged.rows += rows;
    Ok(())
}
