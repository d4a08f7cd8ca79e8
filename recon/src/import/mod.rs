//! Files of others, read from bytes.

mod ply;

pub use ply::{MAX_POINTS, PlyError};
