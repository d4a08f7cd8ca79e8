use v4l::control::{Control, Value};
use v4l::v4l_sys::{
    V4L2_CID_AUTO_WHITE_BALANCE, V4L2_CID_AUTOGAIN, V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CID_EXPOSURE_AUTO,
    V4L2_CID_EXPOSURE_AUTO_PRIORITY, V4L2_CID_GAIN, V4L2_CID_WHITE_BALANCE_TEMPERATURE,
};

use crate::Controls;

/// Values of V4L2_CID_EXPOSURE_AUTO.
const MANUAL: i64 = 1;
const APERTURE_PRIORITY: i64 = 3;

/// What V4L2_CID_EXPOSURE_ABSOLUTE counts: steps of 0.1 ms.
const STEPS_PER_SECOND: f64 = 10_000.0;

/// Sets what was asked for, reads it back and tells what the camera would not do: a picture that is too bright is better
/// than none.
pub(super) fn set(device: &v4l::Device, controls: &Controls, rate: f64) -> Vec<String> {
    let plan = plan(controls, rate);
    plan.into_iter()
        .filter_map(|(id, name, value)| set_one(device, id, value).map(|why| format!("{name}: {why}")))
        .collect()
}

/// One control after the other: automatic ones must be off before their value can be set.
///
/// A webcam has no limit for its automatic exposure but the time from frame to frame, which it keeps to when it is told
/// that the rate comes first. A shorter limit becomes a fixed exposure, and gain is left to do the rest.
fn plan(controls: &Controls, rate: f64) -> Vec<(u32, &'static str, i64)> {
    let mut plan = Vec::new();
    match controls.longest_exposure {
        Some(longest) if longest * rate < 1.0 => {
            let steps = (longest * STEPS_PER_SECOND).floor().max(1.0) as i64;
            plan.push((V4L2_CID_EXPOSURE_AUTO, "fixed exposure", MANUAL));
            plan.push((V4L2_CID_EXPOSURE_ABSOLUTE, "exposure (steps of 0.1 ms)", steps));
        }
        Some(_) => {
            plan.push((V4L2_CID_EXPOSURE_AUTO, "automatic exposure", APERTURE_PRIORITY));
            plan.push((V4L2_CID_EXPOSURE_AUTO_PRIORITY, "exposure longer than a frame", 0));
        }
        None => {}
    }
    if let Some(gain) = controls.gain {
        plan.push((V4L2_CID_AUTOGAIN, "automatic gain", 0));
        plan.push((V4L2_CID_GAIN, "gain", gain.into()));
    }
    if let Some(kelvin) = controls.white_balance {
        plan.push((V4L2_CID_AUTO_WHITE_BALANCE, "automatic white balance", 0));
        plan.push((V4L2_CID_WHITE_BALANCE_TEMPERATURE, "white balance (kelvin)", kelvin.into()));
    }
    plan
}

/// Why the control is not at the value now; `None` when it is.
fn set_one(device: &v4l::Device, id: u32, value: i64) -> Option<String> {
    if let Err(error) = device.set_control(Control { id, value: Value::Integer(value) }) {
        return Some(match error.raw_os_error() {
            Some(libc::EINVAL) => format!("the camera has no such control, or not with {value}"),
            _ => format!("cannot be set to {value}: {error}"),
        });
    }
    match device.control(id) {
        Ok(Control { value: Value::Integer(found), .. }) if found == value => None,
        Ok(Control { value: Value::Boolean(found), .. }) if i64::from(found) == value => None,
        Ok(Control { value: found, .. }) => Some(format!("expected {value}, the camera took {found:?}")),
        Err(error) => Some(format!("cannot be read back: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_shorter_than_a_frame_fixes_the_exposure_and_a_longer_one_keeps_the_rate() {
        let limited = |longest| plan(&Controls { longest_exposure: Some(longest), ..Controls::default() }, 30.0);
        let values = |longest| limited(longest).into_iter().map(|(id, _, value)| (id, value)).collect::<Vec<_>>();
        assert_eq!(values(0.0021), [(V4L2_CID_EXPOSURE_AUTO, MANUAL), (V4L2_CID_EXPOSURE_ABSOLUTE, 21)]);
        assert_eq!(values(1e-9)[1], (V4L2_CID_EXPOSURE_ABSOLUTE, 1), "no camera exposes for no time at all");
        let automatic = [(V4L2_CID_EXPOSURE_AUTO, APERTURE_PRIORITY), (V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0)];
        assert_eq!(values(0.05), automatic);
        assert_eq!(values(f64::INFINITY), automatic);
        assert!(plan(&Controls::default(), 30.0).is_empty(), "what is not asked for is left alone");
    }
}
