use demeter_frame::Intrinsics;

use super::MAX_PIXELS;
use crate::Reason;

/// Why bytes did not become an image.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// No bytes.
    #[error("the frame has no bytes")]
    Empty,
    /// Neither format's first bytes.
    #[error("neither JPEG nor PNG: expected the first bytes ff d8 ff or 89 50 4e 47, found {found:02x?}")]
    NotAnImage {
        /// At most the first four bytes.
        found: Vec<u8>,
    },
    /// A side of zero, or more pixels than are ever decoded.
    #[error(
        "the image must be 1 to {} pixels a side and {MAX_PIXELS} in all, found {width} x {height}",
        Intrinsics::MAX_SIDE
    )]
    Oversized {
        /// Width in the header.
        width: u32,
        /// Height in the header.
        height: u32,
    },
    /// The picture is not what the camera said it would be.
    #[error("the camera announced {} x {} pixels, found {} x {}", expected.0, expected.1, found.0, found.1)]
    Size {
        /// Width and height the camera announced.
        expected: (u32, u32),
        /// Width and height in the header.
        found: (u32, u32),
    },
    /// Rows overlap.
    #[error("the stride must be at least {expected} bytes, found {found}")]
    Stride {
        /// Bytes of a row's pixels.
        expected: usize,
        /// Bytes from row to row.
        found: usize,
    },
    /// The end is missing.
    #[error("the image is cut off after {found} bytes{}", expected.map(|n| format!(" of {n}")).unwrap_or_default())]
    Truncated {
        /// Bytes of the whole image, where its layout tells.
        expected: Option<usize>,
        /// Bytes there are.
        found: usize,
    },
    /// The decoder refused the code.
    #[error("the image is damaged: {found}")]
    Damaged {
        /// What the decoder said.
        found: String,
    },
    /// A whole image of a kind that is not decoded.
    #[error("the image must be grey or RGB in 8 bits (PNG: 16 too), found {found}")]
    Unsupported {
        /// The colours or coding found.
        found: String,
    },
}

impl DecodeError {
    /// The counter this belongs to.
    #[must_use]
    pub fn reason(&self) -> Reason {
        match self {
            Self::Empty => Reason::EmptyFrame,
            Self::NotAnImage { .. } => Reason::NotAnImage,
            Self::Oversized { .. } => Reason::OversizedImage,
            Self::Size { .. } => Reason::SizeMismatch,
            Self::Stride { .. } => Reason::BadStride,
            Self::Truncated { .. } => Reason::TruncatedImage,
            Self::Damaged { .. } => Reason::DamagedImage,
            Self::Unsupported { .. } => Reason::UnsupportedImage,
        }
    }
}
