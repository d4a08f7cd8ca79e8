use super::Fault;

/// The longest line kept, bytes: gpsd's reports are 10 KB at most.
const LONGEST: usize = 16 << 10;

/// Makes lines of whatever pieces bytes come in.
#[derive(Debug, Default)]
pub(super) struct Lines {
    line: Vec<u8>,
    skipping: bool,
}

impl Lines {
    /// Takes bytes in; gives each line that they complete, without its end, or says that one was too long.
    pub(super) fn feed(&mut self, bytes: &[u8], mut take: impl FnMut(Result<&[u8], Fault>)) {
        for piece in bytes.split_inclusive(|byte| *byte == b'\n') {
            let (content, whole) = piece.strip_suffix(b"\n").map_or((piece, false), |content| (content, true));
            if !self.skipping && self.line.len() + content.len() > LONGEST {
                self.skipping = true;
                take(Err(Fault::TooLong));
            }
            if self.skipping {
                self.line.clear();
            } else {
                self.line.extend_from_slice(content);
            }
            if whole {
                if !self.skipping && !self.line.trim_ascii().is_empty() {
                    take(Ok(self.line.trim_ascii()));
                }
                self.line.clear();
                self.skipping = false;
            }
        }
    }
}
