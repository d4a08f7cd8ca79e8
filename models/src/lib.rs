//! Networks behind ONNX Runtime: verified manifests in, checked tensors out.
//!
//! The only crate that names `ort`. A [`Runtime`] is the shared library, loaded once a process; a [`Model`] is a
//! session whose file was verified against its [`Manifest`] before anything parsed it; [`Organ2d`] is our network for
//! organs in pictures, [`Relief2d`] that for their depth, [`Organ3d`] that for organs in point clouds. A model file is
//! refused when it is too large, altered, truncated, keeps weights in other files, or has inputs or outputs other than its
//! manifest says; an output with a NaN or an infinity is an error, because ONNX Runtime passes them on silently.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod depth;
mod depth_anything;
mod error;
mod external;
mod guess;
mod install;
mod instance;
mod layout;
mod manifest;
mod mask_rcnn;
mod meter;
mod model;
mod organ2d;
mod organ3d;
mod organs;
mod pixels;
mod relief2d;
mod runtime;
mod sam;
mod search;
mod signature;
mod tensor;
mod u2net;
mod yolo_seg;

pub use depth::{DepthMap, DepthNetwork};
pub use depth_anything::DepthAnything;
pub use error::ModelError;
pub use guess::CameraGuess;
pub use install::Candidate;
pub use instance::Instance;
pub use layout::Layout;
pub use manifest::{DataSet, Manifest, Port, Provenance};
pub use mask_rcnn::MaskRcnn;
pub use meter::Meter;
pub use model::{MAX_BYTES, Model};
pub use organ2d::{Organ2d, OrganMaps};
pub use organ3d::Organ3d;
pub use organs::OrganNetwork;
pub use relief2d::Relief2d;
pub use runtime::{Runtime, RuntimeError};
pub use sam::{Cutout, Embedding, SamDecoder, SamEncoder};
pub use search::{find_manifest, find_manifests};
pub use tensor::{Outputs, Tensor};
pub use u2net::U2net;
pub use yolo_seg::YoloSeg;
