use std::path::PathBuf;

use crate::error::{CommandError, Exit, chain};

/// Why there is no destination.
#[derive(Debug, thiserror::Error)]
pub enum SyncError {
    /// A key of the configuration.
    #[error("configuration: `sync.{key}`: expected {expected}, found {found}")]
    Config {
        /// The key.
        key: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A file with other content than it should have; secrets are not quoted.
    #[error("{path}: expected {expected}, found {found}")]
    File {
        /// The file.
        path: PathBuf,
        /// What it must hold.
        expected: &'static str,
        /// What it holds.
        found: String,
    },
    /// A file that cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's own error.
        source: std::io::Error,
    },
    /// The client cannot be made.
    #[error("sync: {message}")]
    Client {
        /// Why.
        message: String,
    },
    /// Another program syncs this store just now.
    #[error("{path}: expected no other sync of this store, found one at work")]
    Locked {
        /// The lock.
        path: PathBuf,
    },
}

impl From<SyncError> for CommandError {
    fn from(error: SyncError) -> Self {
        match &error {
            SyncError::Config { expected, found, .. } | SyncError::File { expected, found, .. } => {
                Self::usage("configuration", &error).with(expected, found)
            }
            SyncError::Io { .. } => Self::usage("configuration", chain(&error)),
            SyncError::Client { .. } => Self::failed("sync", &error),
            SyncError::Locked { .. } => Self { exit: Exit::Failed, ..Self::failed("sync_running", &error) },
        }
    }
}

/// Why an object is not there, or not to be had.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The way, the server or its answer: what comes next would fare no better.
    #[error("{doing}: {message}")]
    Server {
        /// `put`, `get` or `list`.
        doing: &'static str,
        /// What went wrong.
        message: String,
    },
    /// The server gave back something else than was sent, or than the key says.
    #[error("{key}: expected {expected}, found {found}")]
    Differs {
        /// The object.
        key: String,
        /// What should have come back.
        expected: &'static str,
        /// What came back.
        found: String,
    },
}

impl From<SendError> for CommandError {
    fn from(error: SendError) -> Self {
        Self::failed("server", &error)
    }
}
