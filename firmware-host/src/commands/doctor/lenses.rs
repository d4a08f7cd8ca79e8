use demeter_frame::Distortion;

use super::Trouble;
use crate::config::CameraConfig;

/// What each configured camera sees: its calibration is read, and is for pictures of the camera's size.
pub(super) fn check(cameras: &[CameraConfig]) -> Result<String, Trouble> {
    let mend = "correct `calibration` of its [[cameras]], or make the file anew: `demeter camera calibrate`";
    let found = |camera: &CameraConfig| {
        let id = &camera.id;
        let calibration = camera
            .calibrated()
            .map_err(|error| Trouble { found: format!("camera {id}: {error}"), mend: mend.into() })?;
        let degrees = calibration.pinhole().hfov().to_degrees();
        let lens = calibration.distortion().map_or("no distortion", Distortion::name);
        Ok(format!("{id} {degrees:.0} degrees, {lens}"))
    };
    Ok(cameras.iter().map(found).collect::<Result<Vec<_>, _>>()?.join("; "))
}
