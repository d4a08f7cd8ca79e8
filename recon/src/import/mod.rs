//! Files of others, read from bytes.

mod ply;
pub mod release;
mod text;

pub use ply::{MAX_POINTS, PlyError};
pub use text::TextError;
