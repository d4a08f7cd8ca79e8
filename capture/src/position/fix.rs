use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// How good a fix is by its kind, the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Dead reckoning, put in by hand or simulated.
    Estimated,
    /// Satellites alone: metres.
    Autonomous,
    /// With corrections of a network or of satellites: about a metre.
    Differential,
    /// Real-time kinematic without whole wavelengths: decimetres.
    RtkFloat,
    /// Real-time kinematic: centimetres.
    RtkFixed,
}

/// Where the antenna was at one moment; also a line of a session's gnss.jsonl.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fix {
    /// The moment on CLOCK_MONOTONIC, nanoseconds: when the fix came, less the receiver's latency.
    pub t_mono_ns: u64,
    /// The boot that the moment belongs to; in gnss.jsonl none where it is named as the session is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boot_id: Option<String>,
    /// The moment by the receiver's own clock, UTC.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<Timestamp>,
    /// Its kind.
    pub quality: Quality,
    /// WGS 84, degrees, north positive.
    pub latitude_deg: f64,
    /// WGS 84, degrees, east positive.
    pub longitude_deg: f64,
    /// Above the ellipsoid, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub altitude_m: Option<f64>,
    /// Horizontal, metres: one standard deviation where the receiver says what it means.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy_m: Option<f64>,
    /// Vertical, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub altitude_accuracy_m: Option<f64>,
    /// Over ground, metres a second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_m_per_s: Option<f64>,
    /// Direction of the drive from true north, clockwise, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub course_deg: Option<f64>,
}

/// The fastest a rig may be, metres a second: a tractor on the road is at 17, and a receiver that says more is wrong.
const FASTEST: f64 = 60.0;

impl Fix {
    /// The key of the first value that no place on Earth has.
    #[must_use]
    pub fn wrong(&self) -> Option<&'static str> {
        let within =
            |value: Option<f64>, range: std::ops::RangeInclusive<f64>| value.is_none_or(|v| range.contains(&v));
        let checks = [
            ("latitude_deg", within(Some(self.latitude_deg), -90.0..=90.0)),
            ("longitude_deg", within(Some(self.longitude_deg), -180.0..=180.0)),
            // From below the deepest shore to above the highest field.
            ("altitude_m", within(self.altitude_m, -1000.0..=10_000.0)),
            ("accuracy_m", within(self.accuracy_m, 0.0..=1e6)),
            ("altitude_accuracy_m", within(self.altitude_accuracy_m, 0.0..=1e6)),
            ("speed_m_per_s", within(self.speed_m_per_s, 0.0..=FASTEST)),
            ("course_deg", within(self.course_deg, 0.0..=360.0)),
        ];
        checks.into_iter().find_map(|(key, fine)| (!fine).then_some(key))
    }

    /// The moment between two fixes, by straight lines; what only one of them knows is not known, and the kind and the
    /// accuracy are the worse one's.
    pub(super) fn between(&self, later: &Self, t_mono_ns: u64) -> Self {
        let span = later.t_mono_ns.saturating_sub(self.t_mono_ns).max(1) as f64;
        let share = t_mono_ns.saturating_sub(self.t_mono_ns) as f64 / span;
        let mix = |a: f64, b: f64| a + share * (b - a);
        let both = |a: Option<f64>, b: Option<f64>, join: &dyn Fn(f64, f64) -> f64| Some(join(a?, b?));
        Self {
            t_mono_ns,
            boot_id: self.boot_id.clone(),
            time: None,
            quality: self.quality.min(later.quality),
            latitude_deg: mix(self.latitude_deg, later.latitude_deg),
            longitude_deg: turned(self.longitude_deg, later.longitude_deg, share, -180.0),
            altitude_m: both(self.altitude_m, later.altitude_m, &mix),
            accuracy_m: both(self.accuracy_m, later.accuracy_m, &f64::max),
            altitude_accuracy_m: both(self.altitude_accuracy_m, later.altitude_accuracy_m, &f64::max),
            speed_m_per_s: both(self.speed_m_per_s, later.speed_m_per_s, &mix),
            course_deg: both(self.course_deg, later.course_deg, &|a, b| turned(a, b, share, 0.0)),
        }
    }
}

/// A share of the shorter way from one angle to another, degrees, in the circle that begins at `start`.
fn turned(from: f64, to: f64, share: f64, start: f64) -> f64 {
    let way = (to - from + 180.0).rem_euclid(360.0) - 180.0;
    (from + share * way - start).rem_euclid(360.0) + start
}
