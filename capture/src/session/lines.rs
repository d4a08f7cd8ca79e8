use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};

use serde::de::DeserializeOwned;

use super::{FrameError, FrameFault};

/// The longest line read, bytes; the longest written is under 1 KiB.
pub(super) const MAX_LINE: u64 = 4096;

/// A JSON Lines file, read one bounded line at a time; a broken line costs itself only.
#[derive(Debug)]
pub(super) struct Lines {
    file: &'static str,
    reader: BufReader<File>,
    number: u64,
}

impl Lines {
    pub(super) fn new(file: &'static str, opened: File) -> Self {
        Self { file, reader: BufReader::new(opened), number: 0 }
    }

    /// The next line; `None` at the end. The outer error ends the file, the inner one the line.
    pub(super) fn next<T: DeserializeOwned>(&mut self) -> io::Result<Option<Result<T, FrameFault>>> {
        let mut line = Vec::new();
        if (&mut self.reader).take(MAX_LINE + 1).read_until(b'\n', &mut line)? == 0 {
            return Ok(None);
        }
        self.number += 1;
        if line.ends_with(b"\n") {
            return Ok(Some(serde_json::from_slice(&line).map_err(|source| FrameFault::Line { source })));
        }
        if line.len() as u64 > MAX_LINE {
            self.reader.skip_until(b'\n')?;
            return Ok(Some(Err(FrameFault::LineTooLong { limit: MAX_LINE })));
        }
        // The last line may lack its end when somebody edited the file; cut inside, it is no object any more.
        let whole = serde_json::from_slice(&line);
        Ok(Some(whole.map_err(|_cut| FrameFault::LineTruncated { found: line.len() })))
    }

    /// Puts the place of the line read last on its fault.
    pub(super) fn fault(&self, fault: FrameFault) -> FrameError {
        FrameError { file: self.file, line: self.number, fault }
    }
}

/// Lines of a file, counted without keeping any.
pub(super) fn count(opened: File) -> io::Result<u64> {
    let mut reader = BufReader::new(opened);
    let mut lines = 0;
    while reader.skip_until(b'\n')? > 0 {
        lines += 1;
    }
    Ok(lines)
}
