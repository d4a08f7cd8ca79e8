//! A recorded session: a folder that holds what the cameras gave, and enough beside it to use it.
//!
//! ```text
//! session.toml   Manifest: rig, cameras with calibration, rows, species
//! index.jsonl    one IndexLine a frame, in the order of arrival
//! poses.jsonl    optional: one PoseLine a frame; the ground is the world's plane z = 0
//! gnss.jsonl     optional: one Fix a line, of the antenna
//! frames/        the cameras' bytes, one file a frame
//! ```
//!
//! Anything else in the folder (truth.json, clouds/) is for others and left alone.

mod error;
mod files;
mod index;
mod lines;
mod manifest;
mod recorder;
mod replay;

pub use error::{FrameError, FrameFault, SessionError};
pub use files::FileFault;
pub use manifest::{ID, LONGEST_ARM, Manifest, ManifestError, Row, SCHEMA_VERSION, SessionCamera, is_id};
pub use recorder::Recorder;
pub use replay::{Pace, Replay};

const MANIFEST: &str = "session.toml";
const INDEX: &str = "index.jsonl";
const POSES: &str = "poses.jsonl";
const FIXES: &str = "gnss.jsonl";
const FRAMES: &str = "frames";

/// The largest file taken for a frame, bytes: a raw frame of 10 megapixels, or any JPEG of [`MAX_PIXELS`](crate::MAX_PIXELS).
pub const MAX_FRAME_BYTES: u64 = 32 << 20;
