//! Networks behind ONNX Runtime: verified manifests in, checked tensors out.
//!
//! The only crate that names `ort`. A [`Runtime`] is the shared library, loaded once a process; a [`Model`] is a
//! session whose file was verified against its [`Manifest`] before anything parsed it; [`Organ2d`] is our network for
//! organs and depth. A model file is refused when it is too large, altered, truncated, keeps weights in other files, or
//! has inputs or outputs other than its manifest says; an output with a NaN or an infinity is an error, because ONNX
//! Runtime passes them on silently.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod error;
mod external;
mod layout;
mod manifest;
mod model;
mod organ2d;
mod runtime;
mod search;
mod signature;
mod tensor;

pub use error::ModelError;
pub use layout::Layout;
pub use manifest::{DataSet, Manifest, Port, Provenance};
pub use model::{MAX_BYTES, Model};
pub use organ2d::{Organ2d, OrganMaps};
pub use runtime::{Runtime, RuntimeError};
pub use search::find_manifest;
pub use tensor::{Outputs, Tensor};
