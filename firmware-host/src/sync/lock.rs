use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use super::error::SyncError;

/// The right to sync a store, held until it is dropped or the program ends.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock beside the store's file.
    ///
    /// # Errors
    /// [`SyncError::Locked`] when another program has it.
    pub fn take(store: &Path) -> Result<Self, SyncError> {
        let mut path = store.as_os_str().to_owned();
        path.push(".sync-lock");
        let io = |source| SyncError::Io { path: path.clone().into(), source };
        let mut options = OpenOptions::new();
        let file = options.create(true).append(true).mode(0o600).open(&path).map_err(io)?;
        match file.try_lock() {
            Ok(()) => Ok(Self { _file: file }),
            Err(TryLockError::WouldBlock) => Err(SyncError::Locked { path: path.into() }),
            Err(TryLockError::Error(error)) => Err(io(error)),
        }
    }
}
