//! gpsd's JSON over TCP: one report a line, of which TPV (time, position, velocity) is read.

use jiff::Timestamp;
use serde::Deserialize;

use super::{Fault, Fix, Quality};

/// Asks gpsd for reports.
pub(super) const WATCH: &[u8] = b"?WATCH={\"enable\":true,\"json\":true};\n";

/// What is read of a report; each class has many more keys.
#[derive(Deserialize)]
struct Report {
    class: String,
    #[serde(default)]
    mode: u8,
    #[serde(default)]
    status: u8,
    time: Option<Timestamp>,
    lat: Option<f64>,
    lon: Option<f64>,
    #[serde(rename = "altHAE")]
    alt_hae: Option<f64>,
    eph: Option<f64>,
    epv: Option<f64>,
    speed: Option<f64>,
    track: Option<f64>,
}

/// The fix that a line reports, at a moment of the monotonic clock; `None` when it reports something else or no fix.
pub(super) fn read(line: &[u8], t_mono_ns: u64) -> Result<Option<Fix>, Fault> {
    let report: Report = serde_json::from_slice(line).map_err(|error| match error.classify() {
        serde_json::error::Category::Eof => Fault::Half,
        serde_json::error::Category::Data => Fault::Value,
        _ => Fault::Noise,
    })?;
    // Modes 2 and 3 are fixes in the plane and in space.
    let (true, 2..=3) = (report.class == "TPV", report.mode) else { return Ok(None) };
    let (Some(latitude_deg), Some(longitude_deg)) = (report.lat, report.lon) else { return Ok(None) };
    let fix = Fix {
        t_mono_ns,
        boot_id: None,
        time: report.time,
        quality: match report.status {
            2 => Quality::Differential,
            3 => Quality::RtkFixed,
            4 => Quality::RtkFloat,
            // Dead reckoning, with satellites and without, and simulated.
            5 | 6 | 8 => Quality::Estimated,
            _ => Quality::Autonomous,
        },
        latitude_deg,
        longitude_deg,
        altitude_m: report.alt_hae,
        accuracy_m: report.eph,
        altitude_accuracy_m: report.epv,
        speed_m_per_s: report.speed,
        course_deg: report.track,
    };
    if fix.wrong().is_some() { Err(Fault::Value) } else { Ok(Some(fix)) }
}
