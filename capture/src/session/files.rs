use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path};

/// Why a file of a session cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum FileFault {
    /// The name, or a symbolic link on its way, leads out of the session's folder.
    #[error("{file:?}: expected a path inside the session's folder, found one that leaves it")]
    Outside {
        /// The name as written.
        file: String,
    },
    /// Nothing there.
    #[error("{file:?}: expected a file, found none")]
    Missing {
        /// The name as written.
        file: String,
    },
    /// A folder, pipe or device.
    #[error("{file:?}: expected a regular file, found something else")]
    NotAFile {
        /// The name as written.
        file: String,
    },
    /// The system refuses.
    #[error("{file:?} cannot be read")]
    Unreadable {
        /// The name as written.
        file: String,
        /// What the system said.
        source: io::Error,
    },
    /// Larger than is ever read.
    #[error("{file:?}: expected at most {limit} bytes, found more")]
    Oversized {
        /// The name as written.
        file: String,
        /// Bytes that are read.
        limit: u64,
    },
}

/// Opens a regular file inside `root`, which must be canonical. Pipes are never opened: they would wait for ever.
pub(super) fn open(root: &Path, file: &str) -> Result<File, FileFault> {
    let name = || file.to_owned();
    let fault = |source: io::Error| match source.kind() {
        io::ErrorKind::NotFound => FileFault::Missing { file: name() },
        _ => FileFault::Unreadable { file: name(), source },
    };
    let relative = Path::new(file);
    if file.is_empty() || !relative.components().all(|part| matches!(part, Component::Normal(_))) {
        return Err(FileFault::Outside { file: name() });
    }
    let path = root.join(relative).canonicalize().map_err(fault)?;
    if !path.starts_with(root) {
        return Err(FileFault::Outside { file: name() });
    }
    if !path.metadata().map_err(fault)?.is_file() {
        return Err(FileFault::NotAFile { file: name() });
    }
    File::open(path).map_err(fault)
}

/// All bytes of a regular file inside `root`, at most `limit` of them.
pub(super) fn read(root: &Path, file: &str, limit: u64) -> Result<Vec<u8>, FileFault> {
    let mut bytes = Vec::new();
    open(root, file)?
        .take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| FileFault::Unreadable { file: file.to_owned(), source })?;
    if bytes.len() as u64 > limit {
        return Err(FileFault::Oversized { file: file.to_owned(), limit });
    }
    Ok(bytes)
}
