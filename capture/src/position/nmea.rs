//! NMEA 0183: the frame and the checksum are looked at here, the fields by the crate `nmea`.

use jiff::civil::{Date, DateTime, Time};
use jiff::tz::TimeZone;
use nmea::ParseResult;
use nmea::sentences::rmc::RmcStatusOfFix;
use nmea::sentences::{FaaMode, FixType};

use super::{Fault, Fix, Quality};

/// How long what one sentence says goes with the fixes of others, nanoseconds: a little more than a slow receiver's turn.
const FRESH_NS: u64 = 1_500_000_000;

/// Metres a second in a knot.
const KNOT: f64 = 1852.0 / 3600.0;

/// What the sentences before said that belongs to a fix as well. GGA has the place and its kind, RMC and VTG the motion,
/// GST the accuracy.
#[derive(Debug, Default)]
pub(super) struct Nmea {
    motion: Said<(f64, Option<f64>)>,
    spread: Said<(f64, Option<f64>)>,
    /// RMC's: GGA has the time of day alone.
    date: Said<(Date, Time)>,
    /// With its time of day.
    gga: Said<Option<Time>>,
}

/// Something that was said, and when.
#[derive(Debug)]
struct Said<T>(Option<(u64, T)>);

impl<T> Default for Said<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Copy> Said<T> {
    fn lately(&self, now: u64) -> Option<T> {
        self.0.filter(|(then, _)| now.saturating_sub(*then) <= FRESH_NS).map(|(_, said)| said)
    }
}

/// A sentence out of a line that may begin with other bytes: receivers send binary protocols in between.
fn sentence(line: &[u8]) -> Result<&str, Fault> {
    let start = line.iter().rposition(|byte| *byte == b'$').ok_or(Fault::Noise)?;
    let text = std::str::from_utf8(&line[start..]).ok().filter(|text| text.is_ascii()).ok_or(Fault::Noise)?;
    let (body, sum) = text[1..].rsplit_once('*').ok_or(Fault::Half)?;
    let sum = u8::from_str_radix(sum, 16).ok().filter(|_| sum.len() == 2).ok_or(Fault::Half)?;
    if body.bytes().fold(0, |sum, byte| sum ^ byte) == sum { Ok(text) } else { Err(Fault::Checksum) }
}

impl Nmea {
    /// The fix that a line gives, at a moment of the monotonic clock; `None` when it gives none.
    pub(super) fn read(&mut self, line: &[u8], t_mono_ns: u64) -> Result<Option<Fix>, Fault> {
        let text = sentence(line)?;
        // Two letters say who talks; proprietary sentences begin with a P and look like nothing of these.
        if !matches!(text.get(3..6), Some("GGA" | "RMC" | "VTG" | "GST")) {
            return Ok(None);
        }
        let fields = nmea::parse_str(text).map_err(|error| match error {
            nmea::Error::SentenceLength(_) => Fault::TooLong,
            _ => Fault::Value,
        })?;
        let fix = match fields {
            ParseResult::GGA(gga) => {
                let clock: Option<Time> = gga.fix_time.and_then(|time| time.to_string().parse().ok());
                let before = self.gga.0.replace((t_mono_ns, clock));
                // Told here, because without a date nobody else can.
                if clock.is_some() && before.is_some_and(|(_, before)| before == clock) {
                    return Err(Fault::StaleTime);
                }
                let quality = gga.fix_type.and_then(quality);
                let place = gga.latitude.zip(gga.longitude);
                let Some((quality, (latitude, longitude))) = quality.zip(place) else { return Ok(None) };
                let altitude = gga.altitude.zip(gga.geoid_separation).map(|(sea, geoid)| f64::from(sea + geoid));
                let time = clock.and_then(|clock| self.time(clock));
                let dilution = gga.hdop.map(f64::from);
                Fix { altitude_m: altitude, ..self.fix(t_mono_ns, time, quality, [latitude, longitude], dilution) }
            }
            ParseResult::RMC(rmc) => {
                let valid = rmc.status_of_fix != RmcStatusOfFix::Invalid && rmc.faa_mode != Some(FaaMode::DataNotValid);
                self.moves(t_mono_ns, rmc.speed_over_ground, rmc.true_course, valid);
                let clock = rmc.fix_date.zip(rmc.fix_time).map(|(date, time)| (date.to_string(), time.to_string()));
                let clock = clock.and_then(|(date, time)| Some((date.parse().ok()?, time.parse().ok()?)));
                self.date = Said(clock.map(|clock| (t_mono_ns, clock)));
                let place = rmc.lat.zip(rmc.lon).filter(|_| valid && self.gga.lately(t_mono_ns).is_none());
                let Some((latitude, longitude)) = place else { return Ok(None) };
                let time = clock.and_then(|(date, time)| utc(date.to_datetime(time)));
                let quality = match rmc.faa_mode {
                    Some(FaaMode::Differential) => Quality::Differential,
                    Some(FaaMode::FloatRtk) => Quality::RtkFloat,
                    Some(FaaMode::FixedRtk) => Quality::RtkFixed,
                    Some(FaaMode::Estimated | FaaMode::Manual | FaaMode::Simulator) => Quality::Estimated,
                    _ if rmc.status_of_fix == RmcStatusOfFix::Differential => Quality::Differential,
                    _ => Quality::Autonomous,
                };
                self.fix(t_mono_ns, time, quality, [latitude, longitude], None)
            }
            ParseResult::VTG(vtg) => {
                self.moves(t_mono_ns, vtg.speed_over_ground, vtg.true_course, true);
                return Ok(None);
            }
            ParseResult::GST(gst) => {
                let flat = gst.lat_sd.zip(gst.long_sd).map(|(north, east)| f64::from(north.hypot(east)));
                let spread = flat.map(|flat| (flat, gst.alt_sd.map(f64::from)));
                self.spread = Said(spread.map(|spread| (t_mono_ns, spread)));
                return Ok(None);
            }
            _ => return Ok(None),
        };
        if fix.wrong().is_some() { Err(Fault::Value) } else { Ok(Some(fix)) }
    }

    fn moves(&mut self, t_mono_ns: u64, knots: Option<f32>, course: Option<f32>, valid: bool) {
        let motion = knots.filter(|_| valid).map(|knots| (f64::from(knots) * KNOT, course.map(f64::from)));
        self.motion = Said(motion.map(|motion| (t_mono_ns, motion)));
    }

    fn fix(&self, t: u64, time: Option<jiff::Timestamp>, quality: Quality, place: [f64; 2], hdop: Option<f64>) -> Fix {
        let (speed, course) = self.motion.lately(t).unzip();
        let (spread, up) = self.spread.lately(t).unzip();
        Fix {
            t_mono_ns: t,
            boot_id: None,
            time,
            quality,
            latitude_deg: place[0],
            longitude_deg: place[1],
            altitude_m: None,
            accuracy_m: spread.or_else(|| Some(hdop? * range_error(quality)?)),
            altitude_accuracy_m: up.flatten(),
            speed_m_per_s: speed,
            course_deg: course.flatten(),
        }
    }

    /// The time of day on the last known date, or on the day after where midnight has gone by since.
    fn time(&self, time: Time) -> Option<jiff::Timestamp> {
        let (_, (date, before)) = self.date.0?;
        let midnight = before.duration_since(time).as_hours() >= 12;
        utc(if midnight { date.tomorrow().ok()? } else { date }.to_datetime(time))
    }
}

fn utc(time: DateTime) -> Option<jiff::Timestamp> {
    // A date of 1980 or 1999 is a receiver that does not know it yet: counters of weeks begin there.
    let known = time.date() > Date::constant(2010, 1, 1);
    time.to_zoned(TimeZone::UTC).ok().filter(|_| known).map(|time| time.timestamp())
}

fn quality(kind: FixType) -> Option<Quality> {
    match kind {
        FixType::Invalid => None,
        FixType::Gps | FixType::Pps => Some(Quality::Autonomous),
        FixType::DGps => Some(Quality::Differential),
        FixType::Rtk => Some(Quality::RtkFixed),
        FixType::FloatRtk => Some(Quality::RtkFloat),
        FixType::Estimated | FixType::Manual | FixType::Simulation => Some(Quality::Estimated),
    }
}

/// Metres of error for a dilution of 1, where the receiver does not tell its accuracy: guesses at what is common.
fn range_error(quality: Quality) -> Option<f64> {
    match quality {
        Quality::Estimated => None,
        Quality::Autonomous => Some(4.0),
        Quality::Differential => Some(1.0),
        Quality::RtkFloat => Some(0.3),
        Quality::RtkFixed => Some(0.015),
    }
}
