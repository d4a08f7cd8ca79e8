//! Cameras of the kernel's own interface, through the crate v4l where that is safe and [`ioctl`] where it is not.
//!
//! Its `Stream` keeps the buffers to itself, asks for frames in a way that fails for ever after one timeout, and panics
//! when it is dropped while the driver is in trouble; so [`stream`] does that part with the kernel's calls.

mod controls;
mod ioctl;
mod list;
mod mode;
mod stream;

use demeter_frame::PixelFormat;
use v4l::FourCC;

pub use list::{Device, OfferedMode, devices};

use crate::camera::driver::{Driver, Stream};
use crate::{CameraFault, CameraSettings};

/// A camera to be opened wherever it is plugged in at that moment.
pub(crate) struct Camera(pub(crate) CameraSettings);

impl Driver for Camera {
    fn open(&self) -> Result<Box<dyn Stream>, CameraFault> {
        let plugged = devices();
        let Some(device) = plugged.iter().find(|device| device.path == self.0.device) else {
            let found = plugged.iter().map(|device| &*device.path).collect::<Vec<_>>().join(", ");
            return Err(CameraFault::Missing { expected: self.0.device.clone(), found });
        };
        let opened = v4l::Device::with_path(&device.node).map_err(CameraFault::refused("opening the camera"))?;
        let layout = mode::set(&opened, &self.0.mode)?;
        for complaint in controls::set(&opened, &self.0.controls, self.0.mode.rate) {
            tracing::warn!("camera {}: {complaint}", self.0.id);
        }
        Ok(Box::new(stream::Buffers::start(opened, layout, self.0.clone())?))
    }
}

/// The kernel's name of a format.
fn fourcc(format: PixelFormat) -> FourCC {
    FourCC::new(match format {
        PixelFormat::Jpeg => b"MJPG",
        PixelFormat::Rgb24 => b"RGB3",
        PixelFormat::Yuyv => b"YUYV",
        PixelFormat::Nv12 => b"NV12",
        PixelFormat::Grey => b"GREY",
    })
}
