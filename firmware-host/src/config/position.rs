use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use demeter_capture::{LONGEST_ARM, ReceiverSettings, ReceiverSource, Speed};
use serde::Deserialize;

use super::camera::BadValue;

/// `[position]`: how the rig knows where it is (docs/service.md).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PositionConfig {
    /// Who tells.
    pub source: PositionSource,
    /// gpsd's address.
    pub gpsd: SocketAddr,
    /// What gives NMEA sentences: a serial line, a pipe or a file that grows.
    pub device: PathBuf,
    /// Bits a second of a serial line. The default is what receivers come with; over USB it means nothing.
    pub baud: u32,
    /// How long after its moment a fix comes, seconds: a guess at what a receiver takes to work it out and send it.
    pub latency_s: f64,
    /// Which side of the drive the cameras look to, where the receiver tells the speed.
    pub cameras_look: Side,
    /// Where the cameras are from the antenna, metres: forwards along the drive, and to the left.
    pub cameras_from_antenna_m: [f64; 2],
}

/// Who tells where the rig is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PositionSource {
    /// Nobody: `source.speed_m_per_s` tells how far it has gone.
    #[default]
    Speed,
    /// gpsd, as JSON over TCP.
    Gpsd,
    /// A receiver, as NMEA sentences.
    Nmea,
}

/// A side of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The row passes from right to left.
    Left,
    /// The row passes from left to right.
    Right,
}

impl Default for PositionConfig {
    fn default() -> Self {
        Self {
            source: PositionSource::default(),
            gpsd: ([127, 0, 0, 1], 2947).into(),
            device: "/dev/ttyACM0".into(),
            baud: 9600,
            latency_s: 0.1,
            cameras_look: Side::Left,
            cameras_from_antenna_m: [0.0, 0.0],
        }
    }
}

impl PositionConfig {
    /// The receiver, where there is one.
    #[must_use]
    pub fn receiver(&self) -> Option<ReceiverSettings> {
        let source = match self.source {
            PositionSource::Speed => return None,
            PositionSource::Gpsd => ReceiverSource::Gpsd(self.gpsd),
            PositionSource::Nmea => ReceiverSource::Nmea { path: self.device.clone(), baud: self.baud },
        };
        Some(ReceiverSettings { source, latency: Duration::from_secs_f64(self.latency_s) })
    }

    /// How fast the rig drives: as it was given, else as the receiver measures it.
    #[must_use]
    pub fn speed(&self, given: Option<f64>) -> Option<Speed> {
        let measured = Speed::Measured { rightwards: self.cameras_look == Side::Right };
        given.map(Speed::Given).or_else(|| self.receiver().map(|_| measured))
    }

    /// [`Self::cameras_from_antenna_m`] of a rig with a receiver.
    #[must_use]
    pub fn arm(&self) -> Option<[f64; 2]> {
        self.receiver().map(|_| self.cameras_from_antenna_m)
    }

    /// Checks what the types do not say.
    ///
    /// # Errors
    /// The first key that is out of bounds.
    pub fn check(&self) -> Result<(), BadValue> {
        if !(0.0..=5.0).contains(&self.latency_s) {
            return Err(("position.latency_s", "0 to 5 seconds", self.latency_s.to_string()));
        }
        if !(1200..=4_000_000).contains(&self.baud) {
            return Err(("position.baud", "1200 to 4000000 bits a second", self.baud.to_string()));
        }
        let arm = self.cameras_from_antenna_m;
        // NaN is in no range.
        if !arm.iter().all(|metres| metres.abs() <= LONGEST_ARM) {
            return Err(("position.cameras_from_antenna_m", "at most 20 metres each way", format!("{arm:?}")));
        }
        Ok(())
    }
}
