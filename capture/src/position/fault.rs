/// Why a line of a receiver was of no use. It costs itself alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// It went on for longer than any sentence or report.
    TooLong,
    /// No sentence at all: another protocol's bytes, or the wrong speed of a serial line.
    Noise,
    /// A sentence or report that breaks off.
    Half,
    /// The bytes are not those that were sent.
    Checksum,
    /// Fields that are missing, no numbers, or no place on Earth.
    Value,
    /// The time of a fix before, or an older one: a receiver that repeats itself has lost its fix.
    StaleTime,
    /// The receiver's clock jumped. The fix is taken all the same, because its place does not depend on that clock.
    TimeJump,
}

impl Fault {
    /// The name of its counter.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::TooLong => "too_long",
            Self::Noise => "noise",
            Self::Half => "half_line",
            Self::Checksum => "checksum",
            Self::Value => "value",
            Self::StaleTime => "stale_time",
            Self::TimeJump => "time_jump",
        }
    }
}
