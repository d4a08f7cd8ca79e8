use std::path::PathBuf;

use rusqlite::ErrorCode;

use crate::error::{CommandError, Exit};

/// Why the store refuses.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// There is no file.
    #[error("store {path}: no such file")]
    Missing {
        /// Its path.
        path: PathBuf,
    },
    /// A file that is no store of this program.
    #[error("store {path}: expected a Demeter store, found {found}")]
    NotAStore {
        /// Its path.
        path: PathBuf,
        /// What it is.
        found: String,
    },
    /// Written by a newer program; the file is left as it is.
    #[error("store {path}: expected schema {expected} or older, found {found}: use the newer program that wrote it")]
    NewerSchema {
        /// Its path.
        path: PathBuf,
        /// The newest schema this program knows.
        expected: usize,
        /// The file's.
        found: usize,
    },
    /// SQLite did not take a setting that the store's promises rest on.
    #[error("store {path}: expected {pragma} = {expected}, found {found}")]
    Pragma {
        /// Its path.
        path: PathBuf,
        /// The setting.
        pragma: &'static str,
        /// The value asked for.
        expected: &'static str,
        /// The value in force.
        found: String,
    },
    /// Somebody else holds it.
    #[error("store {path}: expected to be alone with it, found another reader or writer")]
    Busy {
        /// Its path.
        path: PathBuf,
    },
    /// The id is taken by something else.
    #[error("{what} {id}: already stored with another content")]
    Conflict {
        /// `plant`, `camera`, ...
        what: &'static str,
        /// Its id.
        id: String,
    },
    /// A value that must not be stored.
    #[error("plant {id}: {key} must be {expected}, found {found}")]
    Value {
        /// The plant.
        id: String,
        /// The field or trait.
        key: String,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// SQLite failed.
    #[error("store: {doing}: {source}")]
    Sqlite {
        /// What was being done.
        doing: &'static str,
        /// SQLite's own error.
        source: rusqlite::Error,
    },
    /// JSON in or out of a column failed.
    #[error("store: {doing}: {source}")]
    Json {
        /// What was being done.
        doing: &'static str,
        /// serde's own error.
        source: serde_json::Error,
    },
    /// The file system failed.
    #[error("store {path}: {source}")]
    Io {
        /// The path.
        path: PathBuf,
        /// The system's own error.
        source: std::io::Error,
    },
}

impl StoreError {
    /// Whether the disk has no room: what was acknowledged stays, and the same may be tried again.
    #[must_use]
    pub fn is_full(&self) -> bool {
        matches!(self, Self::Sqlite { source, .. } if source.sqlite_error_code() == Some(ErrorCode::DiskFull))
    }
}

impl From<StoreError> for CommandError {
    fn from(error: StoreError) -> Self {
        let of = |exit, kind| Self { exit, ..Self::failed(kind, &error) };
        match &error {
            StoreError::NewerSchema { expected, found, .. } => {
                of(Exit::NewerSchema, "newer_schema").with(expected, found)
            }
            StoreError::NotAStore { found, .. } => of(Exit::BadUse, "not_a_store").with("a Demeter store", found),
            StoreError::Missing { .. } => of(Exit::BadUse, "no_store"),
            StoreError::Conflict { .. } => of(Exit::Failed, "conflict"),
            _ => of(Exit::Failed, "store"),
        }
    }
}

/// Names what was being done when SQLite or JSON failed.
pub(super) trait Doing<T> {
    fn doing(self, doing: &'static str) -> Result<T, StoreError>;
}

impl<T> Doing<T> for Result<T, rusqlite::Error> {
    fn doing(self, doing: &'static str) -> Result<T, StoreError> {
        self.map_err(|source| StoreError::Sqlite { doing, source })
    }
}

impl<T> Doing<T> for Result<T, serde_json::Error> {
    fn doing(self, doing: &'static str) -> Result<T, StoreError> {
        self.map_err(|source| StoreError::Json { doing, source })
    }
}
