//! From what a network says of one picture to the organs of each plant in it, in space.
//!
//! ```text
//! View ──► instances ──► lift ──► group ──► PlantView ──► Tracker
//!            (2D)       (scale)
//! ```
//!
//! Grasses seen from the side go another way, by their silhouette alone: see [`strap`].
//!
//! Spec: reconstruction.md "Lifting one view"; paper "Single Image Reconstruction" and supp. "2D Reconstruction".
//! Numbers of pixels are stated for a 640 x 480 picture and scale with its area (see [`View::pixels`]), lengths in
//! pixels with its diagonal.

mod anchor;
mod gap;
mod group;
mod instances2d;
mod join;
mod lift;
mod overlay;
mod patches;
mod scale;
mod sharpen;
mod shown;
pub mod strap;
mod track;

use demeter_frame::{CameraError, Depth, Intrinsics, Mask, Pose};
use image::GrayImage;

pub use group::{GroupError, PlantView, Refused, group};
pub use instances2d::{Region, divided, instances};
pub use lift::{DropReason, Dropped, Lifted, LiftedOrgan, lift};
pub use overlay::overlay;
pub use patches::{Patch, patches};
pub use scale::{DepthScale, ScaleError, ground_plane, nominal};
pub use sharpen::{excess_green, sharpened};
pub use shown::shown;
pub use track::{Closed, Gate, Observation, Quality, Tracker};

/// What a network says of one picture, at the network's size, and the camera that took it at that size.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Class of each pixel, the number of its [`demeter_frame::Semantic`].
    pub semantic: &'a GrayImage,
    /// Truncated inverse distance to the nearest pixel of another organ: 0 far, 1 touching.
    pub dist: &'a Mask,
    /// Natural logarithm of depth along the camera's axis, up to one additive constant.
    pub log_depth: &'a Depth,
    /// The camera, for a picture of this size.
    pub intrinsics: Intrinsics,
    /// Where the camera stood in a world whose ground is z = 0, when known.
    pub world_from_camera: Option<Pose>,
}

/// Why rasters are no view.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ViewError {
    /// A raster of another size than the camera's picture.
    #[error("view raster `{raster}`: expected {expected:?} pixels, found {found:?}")]
    Size {
        /// Which raster.
        raster: &'static str,
        /// The camera's width and height.
        expected: (u32, u32),
        /// The raster's.
        found: (u32, u32),
    },
    /// A camera that cannot be.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A pose that cannot be.
    #[error("world_from_camera: expected a unit quaternion and a finite translation, found {found:?}")]
    Pose {
        /// The pose.
        found: Pose,
    },
}

impl View<'_> {
    /// Checks that sizes agree and that camera and pose are possible. Values inside the rasters may be anything: what
    /// is no number is no organ and no depth.
    ///
    /// # Errors
    /// [`ViewError`] naming what is wrong.
    pub fn validated(self) -> Result<Self, ViewError> {
        let Intrinsics { width, height, .. } = self.intrinsics.validated()?;
        let sizes = [
            ("semantic", self.semantic.dimensions()),
            ("dist", self.dist.dimensions()),
            ("log_depth", self.log_depth.dimensions()),
        ];
        for (raster, found) in sizes {
            if found != (width, height) {
                return Err(ViewError::Size { raster, expected: (width, height), found });
            }
        }
        match self.world_from_camera {
            Some(found) if !found.is_valid() => Err(ViewError::Pose { found }),
            _ => Ok(self),
        }
    }

    /// A number of pixels stated for 640 x 480, at this picture's size: an organ covers area, so it scales with area.
    #[must_use]
    pub fn pixels(&self, at_vga: f64) -> usize {
        let area = f64::from(self.intrinsics.width) * f64::from(self.intrinsics.height);
        (at_vga * area / (640.0 * 480.0)).ceil() as usize
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tracking_tests;
