use std::io;
use std::sync::Arc;
use std::time::Duration;

use v4l::device::Handle;
use v4l::v4l_sys::{V4L2_BUF_FLAG_ERROR, V4L2_BUF_FLAG_TIMESTAMP_MASK, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC};

use super::controls;
use super::ioctl::{self, Mapped};
use crate::camera::driver::{Layout, Shot, Stream};
use crate::camera::monotonic_ns;
use crate::{CameraFault, CameraSettings, Controls};

/// Buffers that the driver fills in turn: an eighth of a second at 30 frames a second.
const BUFFERS: u32 = 4;

/// A stamp further than this from now is not believed, nanoseconds: frames wait in buffers for an eighth of a second.
const STRANGE_NS: u64 = 5_000_000_000;

/// A device that fills buffers; dropped, it is stopped and closed, whatever state it is in.
pub(super) struct Buffers {
    handle: Arc<Handle>,
    mapped: Vec<Mapped>,
    layout: Layout,
    device: v4l::Device,
    settings: CameraSettings,
}

impl Buffers {
    pub(super) fn start(device: v4l::Device, layout: Layout, settings: CameraSettings) -> Result<Self, CameraFault> {
        let handle = device.handle();
        let count = ioctl::request_buffers(&handle, BUFFERS).map_err(CameraFault::refused("asking for buffers"))?;
        let mapped = (0..count).map(|index| Mapped::new(&handle, index)).collect::<io::Result<_>>();
        let mapped = mapped.map_err(CameraFault::refused("mapping buffers"))?;
        let buffers = Self { handle, mapped, layout, device, settings };
        for index in 0..count {
            ioctl::queue(&buffers.handle, index).map_err(CameraFault::refused("handing over a buffer"))?;
        }
        ioctl::stream_on(&buffers.handle).map_err(|source| match source.raw_os_error() {
            // What the USB host says when the periodic transfers of all devices together would not fit.
            Some(libc::ENOSPC) => CameraFault::Bandwidth { source },
            _ => CameraFault::Refused { what: "starting the stream", source },
        })?;
        Ok(buffers)
    }
}

impl Stream for Buffers {
    fn layout(&self) -> Layout {
        self.layout
    }

    fn limit_exposure(&mut self, longest: f64) {
        let exposure = Controls { longest_exposure: Some(longest), ..Controls::default() };
        for complaint in controls::set(&self.device, &exposure, self.settings.mode.rate) {
            tracing::debug!("camera {}: {complaint}", self.settings.id);
        }
    }

    fn grab(&mut self, wait: Duration) -> Result<Option<Shot>, CameraFault> {
        let millis = wait.as_millis().try_into().unwrap_or(i32::MAX);
        match self.handle.poll(libc::POLLIN, millis) {
            Ok(0) => return Ok(None),
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return Ok(None),
            Err(source) => return Err(CameraFault::Refused { what: "waiting for a frame", source }),
        }
        let filled = ioctl::dequeue(&self.handle).map_err(CameraFault::refused("fetching a frame"))?;
        let now = monotonic_ns();
        let monotonic = filled.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        let believed = monotonic && filled.stamp_ns.abs_diff(now) < STRANGE_NS;
        let damaged = filled.flags & V4L2_BUF_FLAG_ERROR != 0;
        let Some(mapped) = self.mapped.get(filled.index as usize) else {
            let source = io::Error::other(format!("buffer {} of {}", filled.index, self.mapped.len()));
            return Err(CameraFault::Refused { what: "fetching a frame", source });
        };
        let shot = Shot {
            count: filled.count,
            mono_ns: if believed { filled.stamp_ns } else { now },
            bytes: if damaged { [].into() } else { mapped.copy(filled.used).into() },
            damaged,
        };
        ioctl::queue(&self.handle, filled.index).map_err(CameraFault::refused("handing back a buffer"))?;
        Ok(Some(shot))
    }
}

impl Drop for Buffers {
    fn drop(&mut self) {
        // A device that is gone or in trouble says so here too; closing it, which follows, is what counts.
        let stopped = ioctl::stream_off(&self.handle);
        self.mapped.clear();
        if let Err(error) = stopped.and_then(|()| ioctl::request_buffers(&self.handle, 0)) {
            tracing::debug!("closing a camera: {error}");
        }
    }
}
