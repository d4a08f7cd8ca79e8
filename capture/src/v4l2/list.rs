use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::v4l_sys::{V4L2_CAP_STREAMING, V4L2_CAP_VIDEO_CAPTURE};
use v4l::video::Capture;

use super::ioctl;
use crate::CameraFault;
use demeter_frame::PixelFormat;

/// Where the kernel lists video devices.
const CLASS: &str = "/sys/class/video4linux";

/// A camera that is plugged in.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Device {
    /// Where it is plugged in, which stays when it is unplugged, when others come and when the box starts anew: the bus
    /// and the port, as `usb-0000:00:14.0-1.2`. Further cameras of one port have `#1`, `#2`.. behind it.
    pub path: String,
    /// Where it is for now.
    pub node: PathBuf,
    /// What it calls itself.
    pub name: String,
    /// The kernel's driver.
    pub driver: String,
}

/// Something a camera offers to do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfferedMode {
    /// Layout of the bytes.
    pub format: PixelFormat,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Frames a second, as they are offered; slowest and fastest where anything between will do.
    pub rates: Vec<f64>,
}

/// The cameras that are plugged in, by their path.
#[must_use]
pub fn devices() -> Vec<Device> {
    let mut numbers: Vec<u32> = std::fs::read_dir(CLASS)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_prefix("video")?.parse().ok())
        .collect();
    numbers.sort_unstable();
    let mut seen = BTreeMap::new();
    let mut devices: Vec<_> = numbers
        .into_iter()
        .filter_map(|number| Device::probe(Path::new("/dev").join(format!("video{number}"))))
        .map(|device| {
            let before: &mut u32 = seen.entry(device.path.clone()).or_default();
            let path = if *before == 0 { device.path } else { format!("{}#{before}", device.path) };
            *before += 1;
            Device { path, ..device }
        })
        .collect();
    devices.sort_by(|a, b| a.path.cmp(&b.path));
    devices
}

impl Device {
    /// A node that takes pictures; nodes of metadata, radios and outputs are none.
    fn probe(node: PathBuf) -> Option<Self> {
        let opened = v4l::Device::with_path(&node).ok()?;
        let found = ioctl::capability(&opened.handle()).ok()?;
        let wanted = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        (found.flags & wanted == wanted).then_some(Self {
            path: found.bus,
            node,
            name: found.card,
            driver: found.driver,
        })
    }

    /// What it offers, of the formats that are decoded; sizes between steps are left out but the smallest and largest.
    ///
    /// # Errors
    /// [`CameraFault`] when it is gone.
    pub fn modes(&self) -> Result<Vec<OfferedMode>, CameraFault> {
        let opened = v4l::Device::with_path(&self.node).map_err(CameraFault::refused("opening the camera"))?;
        let mut modes = Vec::new();
        for format in PixelFormat::ALL {
            // A format that the camera has not got has no sizes.
            for size in opened.enum_framesizes(super::fourcc(format)).unwrap_or_default() {
                let sizes = match size.size {
                    FrameSizeEnum::Discrete(size) => vec![(size.width, size.height)],
                    FrameSizeEnum::Stepwise(s) => vec![(s.min_width, s.min_height), (s.max_width, s.max_height)],
                };
                for (width, height) in sizes {
                    let rates = rates(&opened, format, width, height);
                    modes.push(OfferedMode { format, width, height, rates });
                }
            }
        }
        Ok(modes)
    }
}

fn rates(opened: &v4l::Device, format: PixelFormat, width: u32, height: u32) -> Vec<f64> {
    let rate = |interval: v4l::Fraction| f64::from(interval.denominator) / f64::from(interval.numerator.max(1));
    let offered = opened.enum_frameintervals(super::fourcc(format), width, height).unwrap_or_default();
    let each = offered.into_iter().flat_map(|offered| match offered.interval {
        FrameIntervalEnum::Discrete(interval) => vec![rate(interval)],
        FrameIntervalEnum::Stepwise(steps) => vec![rate(steps.max), rate(steps.min)],
    });
    let mut rates: Vec<f64> = each.collect();
    rates.sort_by(f64::total_cmp);
    rates.dedup();
    rates
}
