use std::collections::BTreeMap;
use std::fmt;

use serde::{Serialize, Serializer};

macro_rules! reasons {
    ($($(#[$doc:meta])* $variant:ident = $name:literal,)*) => {
        /// Why a frame went no further. Each has its own counter, and a name that metrics and events may rely on.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Reason {
            $($(#[$doc])* $variant,)*
        }

        impl Reason {
            /// Every reason, in the order of the data path.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The stable name, snake case.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

reasons! {
    /// A line of index.jsonl is not an index line.
    BadIndexLine = "bad_index_line",
    /// The last line of index.jsonl was cut off.
    TruncatedIndexLine = "truncated_index_line",
    /// The index names a camera that session.toml does not.
    UnknownCamera = "unknown_camera",
    /// A line of poses.jsonl is broken; the frame it was for comes without a pose.
    BadPose = "bad_pose",
    /// A line of gnss.jsonl is broken; frames near its time may come without a position.
    BadFix = "bad_fix",
    /// The frame's file lies outside the session's folder.
    UnsafePath = "unsafe_path",
    /// The frame's file is not there.
    MissingFile = "missing_file",
    /// The frame's file is no regular file or cannot be read.
    UnreadableFile = "unreadable_file",
    /// The frame's file is larger than any frame.
    OversizedFile = "oversized_file",
    /// The frame's bytes are not those that were recorded.
    HashMismatch = "hash_mismatch",
    /// The driver marked the frame as damaged.
    DamagedBuffer = "damaged_buffer",
    /// The camera delivered a sequence number that is not above its last.
    BackwardSequence = "backward_sequence",
    /// The camera delivered a monotonic time that is not after its last.
    BackwardTime = "backward_time",
    /// Time or sequence ran so far ahead that the stamp is doubted until a second frame confirms it.
    StampLeap = "stamp_leap",
    /// The same bytes as the camera's frame before.
    Duplicate = "duplicate",
    /// No bytes at all.
    EmptyFrame = "empty_frame",
    /// The bytes are of no known image format.
    NotAnImage = "not_an_image",
    /// The image ends before its end.
    TruncatedImage = "truncated_image",
    /// The image's code is broken.
    DamagedImage = "damaged_image",
    /// The image's header announces more than is ever decoded.
    OversizedImage = "oversized_image",
    /// The image is not of the size the camera announced.
    SizeMismatch = "size_mismatch",
    /// The rows of a raw frame are shorter than its width.
    BadStride = "bad_stride",
    /// Pixels of a kind no rig camera gives, such as CMYK.
    UnsupportedImage = "unsupported_image",
    /// Too little of the image is above black.
    Underexposed = "underexposed",
    /// Too much of the image is white.
    Overexposed = "overexposed",
    /// The image has no sharp detail.
    Blurred = "blurred",
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// How many frames passed, and how many were refused for each reason (only reasons that occurred are listed).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Frames that passed.
    pub passed: u64,
    /// Frames refused, by reason.
    pub refused: BTreeMap<Reason, u64>,
}

impl Counts {
    /// Frames refused for `reason`.
    #[must_use]
    pub fn of(&self, reason: Reason) -> u64 {
        self.refused.get(&reason).copied().unwrap_or(0)
    }

    /// Frames refused for any reason.
    #[must_use]
    pub fn refused_total(&self) -> u64 {
        self.refused.values().sum()
    }

    pub(crate) fn refuse(&mut self, reason: Reason) {
        *self.refused.entry(reason).or_default() += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_distinct_snake_case_and_serialised() {
        let names: std::collections::BTreeSet<_> = Reason::ALL.iter().map(|r| r.name()).collect();
        assert_eq!(names.len(), Reason::ALL.len());
        assert!(names.iter().all(|n| n.bytes().all(|b| b.is_ascii_lowercase() || b == b'_')));
        let mut counts = Counts { passed: 2, ..Counts::default() };
        counts.refuse(Reason::Blurred);
        assert_eq!(serde_json::to_string(&counts).unwrap(), r#"{"passed":2,"refused":{"blurred":1}}"#);
    }
}
