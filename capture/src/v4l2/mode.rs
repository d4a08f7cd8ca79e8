use demeter_frame::PixelFormat;
use v4l::Format;
use v4l::Fraction;
use v4l::video::Capture;
use v4l::video::capture::Parameters;

use crate::camera::driver::Layout;
use crate::{CameraFault, Mode};

/// How far a camera's rate may be from the one asked for: 29.97 is 30.
const RATE_TOLERANCE: f64 = 0.02;

/// Sets the mode and believes nothing but what comes back: drivers take any request and do what they can instead.
pub(super) fn set(device: &v4l::Device, mode: &Mode) -> Result<Layout, CameraFault> {
    let wrong = |found: String| CameraFault::Mode { expected: mode.to_string(), found };
    let asked = Format::new(mode.width, mode.height, super::fourcc(mode.format));
    let given = device.set_format(&asked).map_err(CameraFault::refused("setting the format"))?;
    if given.fourcc != asked.fourcc || (given.width, given.height) != (mode.width, mode.height) {
        return Err(wrong(format!("{} {} x {}", given.fourcc, given.width, given.height)));
    }
    let (row, stride) = (mode.format.row_bytes(mode.width), given.stride);
    if (stride as usize) < row {
        return Err(wrong(format!("rows of {stride} bytes, shorter than their {row} bytes of pixels")));
    }
    let interval = Fraction::new(1000, (mode.rate * 1000.0).round() as u32);
    let given =
        device.set_params(&Parameters::new(interval)).map_err(CameraFault::refused("setting the rate"))?.interval;
    let rate = f64::from(given.denominator) / f64::from(given.numerator);
    // A driver that says nothing of its rate (0/0) is not a number.
    let kept = (rate / mode.rate - 1.0).abs() <= RATE_TOLERANCE;
    if !kept {
        return Err(wrong(format!("{rate:.3} frames a second")));
    }
    let stride = if mode.format == PixelFormat::Jpeg { 0 } else { stride };
    Ok(Layout { format: mode.format, width: mode.width, height: mode.height, stride })
}
