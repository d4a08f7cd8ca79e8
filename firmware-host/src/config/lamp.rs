use std::path::PathBuf;

use serde::Deserialize;

/// `[lamp]`: what the driver sees and hears ([`crate::daemon::lamp`]).
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LampConfig {
    /// An output that takes a number, such as /sys/class/leds/NAME/brightness; none without it.
    pub path: Option<PathBuf>,
    /// Another one that makes a noise.
    pub buzzer: Option<PathBuf>,
}
