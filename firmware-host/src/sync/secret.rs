use std::fs::File;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use reqwest::header::HeaderValue;

use super::error::SyncError;

/// Longest secret, bytes: a guess far above any key or token.
const MAX_BYTES: u64 = 4096;

/// What proves to the server who we are. Never printed, logged or stored.
#[derive(Clone)]
pub struct Secret(String);

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret(..)")
    }
}

impl Secret {
    /// Reads it from a file of ours, else from the systemd credential of that name; `None` where there is neither.
    ///
    /// # Errors
    /// [`SyncError`] when the file cannot be read, is open to others than its owner, or holds no plain text.
    pub fn load(file: Option<&Path>, credential: &str) -> Result<Option<Self>, SyncError> {
        if let Some(path) = file {
            return Self::read(path, true).map(Some);
        }
        let Some(folder) = std::env::var_os("CREDENTIALS_DIRECTORY") else { return Ok(None) };
        let path = PathBuf::from(folder).join(credential);
        // systemd guards its folder itself, with modes of its own.
        if path.exists() { Self::read(&path, false).map(Some) } else { Ok(None) }
    }

    fn read(path: &Path, ours: bool) -> Result<Self, SyncError> {
        let io = |source| SyncError::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        let mode = file.metadata().map_err(io)?.permissions().mode() & 0o777;
        if ours && mode & 0o077 != 0 {
            let found = format!("{mode:04o}");
            return Err(SyncError::File { path: path.into(), expected: "mode 0600", found });
        }
        let mut text = String::new();
        file.take(MAX_BYTES).read_to_string(&mut text).map_err(io)?;
        let secret = text.trim();
        // What is there must not be quoted.
        if secret.is_empty() || !secret.chars().all(|c| c.is_ascii_graphic()) {
            let found = if secret.is_empty() { "nothing" } else { "other characters" };
            let expected = "one line of printable ASCII without spaces";
            return Err(SyncError::File { path: path.into(), expected, found: found.into() });
        }
        Ok(Self(secret.to_owned()))
    }

    pub(super) fn new(text: String) -> Self {
        Self(text)
    }

    /// The secret itself, for the wire alone.
    pub(super) fn reveal(&self) -> &str {
        &self.0
    }
}

/// The header that proves who we are, which is never printed.
pub(super) fn authorization(scheme: &str, secret: &Secret) -> Result<HeaderValue, SyncError> {
    let header = HeaderValue::from_str(&format!("{scheme} {}", secret.reveal()));
    let mut header = header.map_err(|error| SyncError::Client { message: error.to_string() })?;
    header.set_sensitive(true);
    Ok(header)
}
