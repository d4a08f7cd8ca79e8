use demeter_frame::Frame;

use crate::Reason;

/// A gap in time that nobody believes at once, nanoseconds: one hour (a guess: longer than a stop at the headland).
const LEAP_NS: u64 = 3_600_000_000_000;

/// A gap in the sequence that nobody believes at once: an hour at 100 frames a second, rounded up.
const LEAP_SEQ: u64 = 400_000;

/// One camera's place in time: what came last, and a leap that waits to be confirmed.
///
/// A single forged stamp far ahead would otherwise make every later frame of the camera backward.
#[derive(Debug, Default)]
pub(crate) struct Order {
    last: Option<Mark>,
    leap: Option<Mark>,
}

#[derive(Clone, Debug)]
struct Mark {
    boot_id: String,
    seq: u64,
    mono_ns: u64,
}

impl Order {
    /// Takes the frame's stamp for the camera's latest, or tells why not.
    pub(crate) fn advance(&mut self, frame: &Frame) -> Result<(), Reason> {
        let mark = Mark { boot_id: frame.stamp.boot_id.clone(), seq: frame.seq, mono_ns: frame.stamp.mono_ns };
        match mark.follows(self.last.as_ref()) {
            Err(Reason::StampLeap) if self.leap.is_none() || mark.follows(self.leap.as_ref()).is_err() => {
                self.leap = Some(mark);
                Err(Reason::StampLeap)
            }
            Ok(()) | Err(Reason::StampLeap) => {
                *self = Self { last: Some(mark), leap: None };
                Ok(())
            }
            Err(reason) => Err(reason),
        }
    }
}

impl Mark {
    /// Sequence and time must rise within a boot; a new boot starts anew.
    fn follows(&self, before: Option<&Self>) -> Result<(), Reason> {
        let Some(before) = before.filter(|before| before.boot_id == self.boot_id) else { return Ok(()) };
        if self.seq <= before.seq {
            Err(Reason::BackwardSequence)
        } else if self.mono_ns <= before.mono_ns {
            Err(Reason::BackwardTime)
        } else if self.seq - before.seq > LEAP_SEQ || self.mono_ns - before.mono_ns > LEAP_NS {
            Err(Reason::StampLeap)
        } else {
            Ok(())
        }
    }
}
