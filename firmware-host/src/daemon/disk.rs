//! Room on the disk: plants wait before it is full, because a store without room can neither write nor tidy up.
//!
//! Should others fill the disk nevertheless, the store's [`Reserve`] is given back, and taken again when there is room.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use crate::store::Reserve;

/// How many times the least free space must be free again before storing goes on, so that it does not stop and go.
const ENOUGH: u64 = 2;

/// A small disk need not have more free than one part in so many of it (a guess).
const SMALL: u64 = 16;

/// Free bytes and whether plants wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Room {
    /// Bytes that this program may still write; none where the file system does not say.
    pub free_bytes: Option<u64>,
    /// So many must be free before plants that wait are stored.
    pub enough_bytes: u64,
    /// Plants wait until there is room.
    pub full: bool,
    /// The store's reserve is held; it is given back on a full disk.
    pub reserve: bool,
}

/// Decides whether plants may be stored.
#[derive(Debug)]
pub struct Disk {
    folder: PathBuf,
    min_free: u64,
    full: bool,
    reserve: Arc<Reserve>,
}

impl Disk {
    /// A governor of the disk that holds the store; `min_free` is in bytes.
    #[must_use]
    pub fn new(store: &Path, min_free: u64) -> Self {
        let reserve = Arc::new(Reserve::of(store));
        Self { folder: folder_of(store).into(), min_free, full: false, reserve }
    }

    /// Looks how much is free; `failed` says that the store itself found no room since the last look.
    pub fn update(&mut self, failed: bool) -> Room {
        self.decide(space(&self.folder).ok(), failed)
    }

    /// Whether the reserve is to be held, where that is to change.
    #[must_use]
    pub fn change(&self, room: &Room, failed: bool) -> Option<bool> {
        let free = room.free_bytes?;
        // Plants wait first: what is given back is for what makes room, and not for more of them.
        let scarce = failed || room.full && free < Reserve::SCARCE;
        let plenty = !room.full && free >= room.enough_bytes + Reserve::BYTES;
        (room.reserve && scarce || !room.reserve && plenty).then_some(!room.reserve)
    }

    /// The store's reserve, for a thread that may block.
    #[must_use]
    pub fn reserve(&self) -> Arc<Reserve> {
        self.reserve.clone()
    }

    /// Another bound, bytes.
    pub fn configure(&mut self, min_free: u64) {
        self.min_free = min_free;
    }

    fn decide(&mut self, space: Option<Space>, failed: bool) -> Room {
        let least = space.map_or(self.min_free, |space| self.min_free.min(space.size / SMALL));
        let enough_bytes = least.saturating_mul(ENOUGH);
        let bound = if self.full { enough_bytes } else { least };
        let held = self.reserve.is_held();
        // The reserve's room is not for plants, taken or not.
        let kept = if held { 0 } else { Reserve::BYTES };
        // A store that fails although the system counts room is tried again at the next look.
        self.full = space.map_or(failed, |space| space.free.saturating_sub(kept) < bound);
        let free_bytes = space.map(|space| space.free);
        Room { free_bytes, enough_bytes, full: self.full, reserve: held }
    }
}

/// The folder that a file is in.
pub(crate) fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Bytes of a disk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Space {
    /// What a program without privileges may still write.
    pub(crate) free: u64,
    /// The whole disk.
    size: u64,
}

/// The space of the disk that holds the folder.
///
/// # Errors
/// The system's own, where the folder is not there.
pub(crate) fn space(folder: &Path) -> std::io::Result<Space> {
    let found = rustix::fs::statvfs(folder)?;
    let bytes = |blocks: u64| blocks.saturating_mul(found.f_frsize);
    Ok(Space { free: bytes(found.f_bavail), size: bytes(found.f_blocks) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disk(folder: &Path, min_free: u64) -> Disk {
        Disk::new(&folder.join("demeter.sqlite"), min_free)
    }

    #[test]
    fn plants_wait_below_the_bound_and_go_on_well_above_it() {
        let folder = tempfile::tempdir().unwrap();
        // A large disk keeps the bound, a small one has a sixteenth of itself for one.
        for (size, min_free) in [(100_000, 100), (1600, 10_000)] {
            let mut disk = disk(folder.path(), min_free);
            disk.reserve.hold(true).unwrap();
            let full = [(500, false), (100, false), (99, true), (150, true), (199, true), (200, false), (150, false)];
            for (free, full) in full {
                let room = disk.decide(Some(Space { free, size }), false);
                let expected = Room { free_bytes: Some(free), enough_bytes: 200, full, reserve: true };
                assert_eq!(room, expected, "{free} of {size}");
            }
            assert!(disk.decide(None, true).full, "without a count the store's word is taken");
            assert!(!disk.decide(None, false).full);
            // Room that the reserve gave back is none for plants.
            disk.reserve.hold(false).unwrap();
            assert!(disk.decide(Some(Space { free: Reserve::BYTES + 99, size }), false).full);
            assert!(!disk.decide(Some(Space { free: Reserve::BYTES + 200, size }), false).full);
        }
    }

    #[test]
    fn the_reserve_is_given_back_where_room_is_scarce_and_taken_where_there_is_plenty() {
        let folder = tempfile::tempdir().unwrap();
        let disk = disk(folder.path(), 0);
        let room = |free, full, reserve| Room { free_bytes: Some(free), enough_bytes: 1000, full, reserve };
        let plenty = 1000 + Reserve::BYTES;
        for (room, failed, change) in [
            (room(plenty, false, false), false, Some(true)),
            (room(plenty - 1, false, false), false, None),
            (room(plenty, true, false), false, None),
            (room(plenty, false, true), false, None),
            (room(Reserve::SCARCE, true, true), false, None),
            (room(Reserve::SCARCE - 1, true, true), false, Some(false)),
            (room(Reserve::SCARCE - 1, false, true), false, None),
            (room(plenty, false, true), true, Some(false)),
            (Room { free_bytes: None, ..room(0, true, true) }, true, None),
        ] {
            assert_eq!(disk.change(&room, failed), change, "{room:?}, {failed}");
        }
    }

    #[test]
    fn the_disk_of_a_file_without_a_folder_is_this_one() {
        assert_eq!(folder_of(Path::new("demeter.sqlite")), Path::new("."));
        let space = space(Path::new(".")).unwrap();
        assert!(space.free > 0 && space.free <= space.size);
        assert!(super::space(Path::new("/no/such/folder")).is_err());
    }
}
