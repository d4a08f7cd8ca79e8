use serde::{Deserialize, Serialize};

/// When a frame was taken: the monotonic clock orders frames, the wall clock only labels them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    /// CLOCK_MONOTONIC, nanoseconds since the boot named by `boot_id`.
    pub mono_ns: u64,
    /// RFC 3339 UTC wall time as the box believed it; may be wrong until the clock is synchronised.
    pub wall: String,
    /// The kernel's boot id (or the session's id for synthetic frames): monotonic times of two boots do not compare.
    pub boot_id: String,
}
