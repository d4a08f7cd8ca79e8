//! Vocabulary shared by every layer: what a frame is, where a camera stood, and the rasters that pass between stages.
//!
//! Nothing here does I/O or knows a device, a network or a plant. Units are SI, angles radians, camera axes OpenCV's
//! (x right, y down, z forward), the world right-handed with z up.

mod calibration;
mod camera;
mod distortion;
mod frame;
mod pose;
mod pyramid;
mod raster;
mod stamp;
mod undistort;

pub use calibration::{Calibration, OutOfView};
pub use camera::{CameraError, Intrinsics, Pinhole, Tilt};
pub use distortion::Distortion;
pub use frame::{CameraId, Frame, PixelFormat};
pub use pose::Pose;
pub use pyramid::{ABOVE, LOCAL, NEIGHBOURS, PointMaps, PointPyramid, PyramidLevel};
pub use raster::{Depth, Instances, Mask, Rgb, Semantic};
pub use stamp::Stamp;
pub use undistort::Undistort;
