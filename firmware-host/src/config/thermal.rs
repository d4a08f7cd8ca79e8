use std::path::PathBuf;

use serde::Deserialize;

/// `[thermal]`: when load is shed ([`crate::daemon::thermal`]).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThermalConfig {
    /// Where the kernel's `thermal_zone*` are.
    pub folder: PathBuf,
    /// At this temperature and above load is shed, degrees Celsius. The default is where a Raspberry Pi slows itself
    /// down.
    pub hot_c: f64,
    /// At this temperature and below it is taken up again, degrees Celsius.
    pub cool_c: f64,
}

impl Default for ThermalConfig {
    fn default() -> Self {
        Self { folder: "/sys/class/thermal".into(), hot_c: 80.0, cool_c: 70.0 }
    }
}
