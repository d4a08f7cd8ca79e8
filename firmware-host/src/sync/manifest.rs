use serde::{Deserialize, Serialize};

/// What tells the readers of a bucket which files of a month to read: `compacted/month=2026-06/manifest.json`.
///
/// It is the one object of a bucket that is ever put again, and servers put an object whole or not at all. So whichever
/// manifest a reader finds, the files that it names and the daily files that it does not name are each row once.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Such as `2026-06`.
    pub month: String,
    /// The tables of plants.
    pub plants: Merged,
    /// The tables of organs.
    pub organs: Merged,
}

/// The files of one table in one month.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Merged {
    /// Keys of merged files, which are to be read.
    pub files: Vec<String>,
    /// Keys of the daily files that they hold, which are not to be read.
    pub sources: Vec<String>,
    /// How many rows they have.
    pub rows: u64,
}

/// The folder of a month's merged files.
pub(super) fn folder(month: &str) -> String {
    format!("{COMPACTED}/month={month}")
}

/// The key of a month's manifest.
pub(super) fn key(month: &str) -> String {
    format!("{}/manifest.json", folder(month))
}

/// Everything that compaction makes lies below this.
pub(super) const COMPACTED: &str = "compacted";
