//! Room on the disk: plants wait before it is full, because a store without room can neither write nor tidy up.

use std::path::{Path, PathBuf};

use serde::Serialize;

/// How many times the least free space must be free again before storing goes on, so that it does not stop and go.
const ENOUGH: u64 = 2;

/// Free bytes and whether plants wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Room {
    /// Bytes that this program may still write; none where the file system does not say.
    pub free_bytes: Option<u64>,
    /// Plants wait until there is room.
    pub full: bool,
}

/// Decides whether plants may be stored.
#[derive(Debug)]
pub struct Disk {
    folder: PathBuf,
    min_free: u64,
    full: bool,
}

impl Disk {
    /// A governor of the disk that holds the store; `min_free` is in bytes.
    #[must_use]
    pub fn new(store: &Path, min_free: u64) -> Self {
        Self { folder: folder_of(store).into(), min_free, full: false }
    }

    /// Looks how much is free; `failed` says that the store itself found no room since the last look.
    pub fn update(&mut self, failed: bool) -> Room {
        self.decide(free_bytes(&self.folder).ok(), failed)
    }

    /// Another bound, bytes.
    pub fn configure(&mut self, min_free: u64) {
        self.min_free = min_free;
    }

    fn decide(&mut self, free_bytes: Option<u64>, failed: bool) -> Room {
        let least = if self.full { self.min_free.saturating_mul(ENOUGH) } else { self.min_free };
        // A store that fails although the system counts room is tried again at the next look.
        self.full = free_bytes.map_or(failed, |free| free < least);
        Room { free_bytes, full: self.full }
    }
}

/// The folder that a file is in.
pub(crate) fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Bytes that a program without privileges may still write into the folder.
///
/// # Errors
/// The system's own, where the folder is not there.
pub(crate) fn free_bytes(folder: &Path) -> std::io::Result<u64> {
    let space = rustix::fs::statvfs(folder)?;
    Ok(space.f_bavail.saturating_mul(space.f_frsize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plants_wait_below_the_bound_and_go_on_well_above_it() {
        let mut disk = Disk::new(Path::new("demeter.sqlite"), 100);
        let full = [(500, false), (100, false), (99, true), (150, true), (199, true), (200, false), (150, false)];
        for (free, full) in full {
            assert_eq!(disk.decide(Some(free), false), Room { free_bytes: Some(free), full }, "{free}");
        }
        assert!(disk.decide(None, true).full, "without a count the store's word is taken");
        assert!(!disk.decide(None, false).full);
    }

    #[test]
    fn the_disk_of_a_file_without_a_folder_is_this_one() {
        assert_eq!(folder_of(Path::new("demeter.sqlite")), Path::new("."));
        assert!(free_bytes(Path::new(".")).unwrap() > 0);
        assert!(free_bytes(Path::new("/no/such/folder")).is_err());
    }
}
