use std::fs::{self, File};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::fs::{FallocateFlags, fallocate};

use super::connection::LOG_CAP;

/// A file that takes up room beside the store and gives it back when the disk is full: without any room a store can
/// neither delete rows nor bring its log into the file, and so could not even make room by itself.
#[derive(Debug)]
pub struct Reserve {
    path: PathBuf,
    held: AtomicBool,
    /// One change at a time.
    changing: Mutex<()>,
}

impl Reserve {
    /// The room held, bytes: twice what the log grows to (spec/reliability.md 5), once for the log and once for what it
    /// brings into the store's file.
    pub const BYTES: u64 = 2 * LOG_CAP;

    /// With less free than this, bytes, the log itself may not fit: the room is given back.
    pub const SCARCE: u64 = LOG_CAP;

    /// The reserve of a store, as it was left.
    #[must_use]
    pub fn of(store: &Path) -> Self {
        let mut path = store.as_os_str().to_owned();
        path.push("-reserve");
        let path = PathBuf::from(path);
        let held = AtomicBool::new(path.exists());
        Self { path, held, changing: Mutex::default() }
    }

    /// Whether the room is held now.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held.load(Ordering::Relaxed)
    }

    /// Takes the room, or gives it back; at once and without a word where that was done before, or is being done.
    ///
    /// # Errors
    /// The system's. There is no room to take, for example; then none is held.
    pub fn hold(&self, hold: bool) -> io::Result<()> {
        let Ok(_changing) = self.changing.try_lock() else { return Ok(()) };
        if hold == self.is_held() {
            return Ok(());
        }
        if hold {
            self.take()?
        } else {
            fs::remove_file(&self.path)?
        }
        self.held.store(hold, Ordering::Relaxed);
        Ok(())
    }

    fn take(&self) -> io::Result<()> {
        let file = File::options().write(true).create(true).truncate(true).mode(0o600).open(&self.path)?;
        // Not written, so it costs a card nothing, and a file system that packs zeros cannot do without the room.
        let taken = fallocate(&file, FallocateFlags::empty(), 0, Self::BYTES);
        taken.map_err(io::Error::from).or_else(|error| fs::remove_file(&self.path).and(Err(error)))
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;

    use super::*;

    #[test]
    fn room_is_taken_for_real_and_given_back() {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("demeter.sqlite");
        let reserve = Reserve::of(&store);
        for _ in 0..2 {
            reserve.hold(true).unwrap();
            let file = fs::metadata(&reserve.path).unwrap();
            assert!(file.blocks() * 512 >= Reserve::BYTES, "{} blocks", file.blocks());
        }
        assert!(Reserve::of(&store).is_held(), "the next start knows of it");
        for _ in 0..2 {
            reserve.hold(false).unwrap();
            assert!(!reserve.path.exists() && !reserve.is_held());
        }
        let nowhere = Reserve::of(Path::new("/no/such/folder/demeter.sqlite"));
        assert!(nowhere.hold(true).is_err() && !nowhere.is_held());
    }
}
