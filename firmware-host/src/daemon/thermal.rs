//! Heat: a box that is about to be throttled by its processor sheds load by itself, before that.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::config::ThermalConfig;

/// One part of so many of the time is worked, from cool to hot.
const STEPS: [u32; 4] = [1, 2, 4, 8];

/// After shedding, so long is waited to see what it did: a guess at how fast a box's temperature answers.
const SETTLE: Duration = Duration::from_secs(3);

/// A box must have been cool for so long before it takes up load again: it heats faster than it cools.
const RECOVER: Duration = Duration::from_secs(30);

/// What a sensor can say, degrees Celsius; anything else is a broken one.
const BELIEVED_C: std::ops::Range<f64> = -60.0..150.0;

/// Sheds load when the box is hot and takes it up again when it is cool; between the two thresholds nothing changes.
#[derive(Debug)]
pub struct Thermal {
    config: ThermalConfig,
    step: usize,
    /// When the step changed last.
    changed: Option<Instant>,
    /// When it was last too warm to take up load, or the step changed.
    warm: Option<Instant>,
}

/// How hot it is and what follows from that.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Heat {
    /// The hottest sensor, degrees Celsius; none where no sensor answers.
    pub celsius: Option<f64>,
    /// One part of so many of the time is worked: 1 is all of it.
    pub slowness: u32,
}

impl Default for Heat {
    fn default() -> Self {
        Self { celsius: None, slowness: STEPS[0] }
    }
}

impl Thermal {
    /// A governor of a box that is cool so far.
    #[must_use]
    pub fn new(config: ThermalConfig) -> Self {
        Self { config, step: 0, changed: None, warm: None }
    }

    /// Reads the sensors and decides.
    pub fn update(&mut self, now: Instant) -> Heat {
        let celsius = hottest(&self.config.folder);
        let since = |then: Option<Instant>| then.map_or(Duration::MAX, |then| now.saturating_duration_since(then));
        // Sensors that fall silent leave everything as it is.
        let step = match celsius {
            Some(celsius) if celsius >= self.config.hot_c && since(self.changed) >= SETTLE => {
                (self.step + 1).min(STEPS.len() - 1)
            }
            Some(celsius) if celsius <= self.config.cool_c && since(self.warm) >= RECOVER => {
                self.step.saturating_sub(1)
            }
            _ => self.step,
        };
        let changed = step != self.step;
        if changed {
            (self.step, self.changed) = (step, Some(now));
        }
        if changed || celsius.is_none_or(|celsius| celsius > self.config.cool_c) {
            self.warm = Some(now);
        }
        Heat { celsius, slowness: STEPS[self.step] }
    }

    /// Other thresholds or another folder; load that was shed stays shed until it is cool.
    pub fn configure(&mut self, config: ThermalConfig) {
        self.config = config;
    }
}

/// The hottest of a folder's `thermal_zone*/temp`, which are in thousandths of a degree.
fn hottest(folder: &Path) -> Option<f64> {
    let zones = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let zones =
        zones.filter(|path| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"thermal_zone")));
    let read = |zone: PathBuf| fs::read_to_string(zone.join("temp")).ok()?.trim().parse::<f64>().ok();
    let celsius = zones.filter_map(read).map(|thousandths| thousandths / 1e3);
    celsius.filter(|celsius| BELIEVED_C.contains(celsius)).max_by(f64::total_cmp)
}
