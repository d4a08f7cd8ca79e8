use std::io;
use std::path::PathBuf;

use super::{FIXES, FileFault, ManifestError, POSES};
use crate::Reason;

/// Why a session as a whole cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// session.toml, index.jsonl, poses.jsonl or gnss.jsonl cannot be opened.
    #[error("session {}: {file}", path.display())]
    File {
        /// The session's folder.
        path: PathBuf,
        /// The file in it.
        file: &'static str,
        /// What is wrong with it.
        source: FileFault,
    },
    /// session.toml was read and says something wrong.
    #[error("{}", path.display())]
    Manifest {
        /// The session.toml.
        path: PathBuf,
        /// The key, what was expected and what was found.
        source: ManifestError,
    },
    /// Reading or writing failed.
    #[error("{}", path.display())]
    Io {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A recording must not be written over another.
    #[error("{} holds a session already; choose another folder", path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// poses.jsonl or gnss.jsonl holds more than a session can have, or little but broken lines.
    #[error("{}: expected at most {limit} {what}, found more", path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
        /// Its lines, or broken ones.
        what: &'static str,
        /// How many are held.
        limit: usize,
    },
    /// A fix that no reader would take back.
    #[error("a fix cannot be recorded")]
    Fix {
        /// What is wrong with it.
        source: FrameFault,
    },
    /// A frame that no reader would take back.
    #[error("frame {seq} of camera {camera} cannot be recorded")]
    Frame {
        /// Its camera.
        camera: String,
        /// Its number.
        seq: u64,
        /// What is wrong with it.
        source: FrameFault,
    },
}

/// One line of the recording gave no frame (or no pose, or no fix); the lines behind it are unharmed.
#[derive(Debug, thiserror::Error)]
#[error("{file} line {line}")]
pub struct FrameError {
    /// index.jsonl, poses.jsonl or gnss.jsonl.
    pub file: &'static str,
    /// Number of the line, from 1.
    pub line: u64,
    /// What is wrong.
    #[source]
    pub fault: FrameFault,
}

/// What is wrong with one line or its frame.
#[derive(Debug, thiserror::Error)]
pub enum FrameFault {
    /// A line that goes on and on.
    #[error("expected a line of at most {limit} bytes, found a longer one")]
    LineTooLong {
        /// Bytes that are read.
        limit: u64,
    },
    /// The file ends inside the line.
    #[error("expected a whole line, found {found} bytes without an end")]
    LineTruncated {
        /// Bytes found.
        found: usize,
    },
    /// Not the JSON object it should be.
    #[error("not a line of this file")]
    Line {
        /// Where the parser stopped, what it expected and found.
        source: serde_json::Error,
    },
    /// A value that parses and makes no sense.
    #[error("{key}: expected {expected}, found {found}")]
    Value {
        /// The key.
        key: &'static str,
        /// What belongs there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A camera that session.toml does not have.
    #[error("camera: expected one of session.toml, found {found:?}")]
    UnknownCamera {
        /// The name in the line.
        found: String,
    },
    /// The frame's file cannot be had.
    #[error(transparent)]
    File(#[from] FileFault),
    /// Other bytes than were recorded.
    #[error("{file}: expected blake3 {expected}, found {found}")]
    Hash {
        /// The frame's file.
        file: String,
        /// The hash in the index.
        expected: String,
        /// The hash of the bytes.
        found: String,
    },
}

impl FrameError {
    /// The counter this belongs to.
    #[must_use]
    pub fn reason(&self) -> Reason {
        match self.file {
            POSES => return Reason::BadPose,
            FIXES => return Reason::BadFix,
            _ => {}
        }
        match &self.fault {
            FrameFault::LineTooLong { .. } | FrameFault::Line { .. } | FrameFault::Value { .. } => Reason::BadIndexLine,
            FrameFault::LineTruncated { .. } => Reason::TruncatedIndexLine,
            FrameFault::UnknownCamera { .. } => Reason::UnknownCamera,
            FrameFault::Hash { .. } => Reason::HashMismatch,
            FrameFault::File(FileFault::Outside { .. }) => Reason::UnsafePath,
            FrameFault::File(FileFault::Missing { .. }) => Reason::MissingFile,
            FrameFault::File(FileFault::NotAFile { .. } | FileFault::Unreadable { .. }) => Reason::UnreadableFile,
            FrameFault::File(FileFault::Oversized { .. }) => Reason::OversizedFile,
        }
    }
}
