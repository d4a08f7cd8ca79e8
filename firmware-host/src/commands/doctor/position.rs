use std::net::TcpStream;
use std::time::{Duration, Instant};

use demeter_capture::{PositionHealth, PositionState, Receiver};

use super::Trouble;
use crate::config::PositionConfig;

/// How long a receiver is listened to: three fixes of one that gives one a second.
const LISTENING: Duration = Duration::from_secs(3);

/// How long gpsd may take to answer the door.
const KNOCKING: Duration = Duration::from_millis(200);

/// Listens to the configured receiver; without one, says what could be configured.
pub(super) fn check(config: &PositionConfig) -> Result<String, Trouble> {
    let Some(settings) = config.receiver() else { return Ok(unused(config)) };
    let failed = |error: std::io::Error| Trouble { found: error.to_string(), mend: "restart the box".into() };
    let receiver = Receiver::open(settings).map_err(failed)?;
    let positions = receiver.positions();
    let health = || positions.health().unwrap_or_default();
    let deadline = Instant::now() + LISTENING;
    while health().state != PositionState::Fix && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(100));
    }
    judge(&health())
}

fn judge(health: &PositionHealth) -> Result<String, Trouble> {
    let PositionHealth { receiver, sentences, faults, last, last_error, .. } = health;
    let heard = format!("{receiver}: {sentences} sentences, unusable {faults:?}");
    let trouble = |found: String, mend: &str| Err(Trouble { found, mend: mend.into() });
    match (health.state, last, last_error) {
        (PositionState::Fix, Some(fix), _) => {
            let accuracy = fix.accuracy_m.map_or_else(|| "accuracy unknown".into(), |metres| format!("{metres:.2} m"));
            let (latitude, longitude) = (fix.latitude_deg, fix.longitude_deg);
            Ok(format!("{heard}, fix {:?}, {accuracy}, at {latitude:.7}, {longitude:.7}", fix.quality))
        }
        (PositionState::Lost, _, Some(why)) => trouble(
            format!("{receiver}: {why}"),
            "plug the receiver in or start gpsd; [position] says where it is read",
        ),
        _ if *sentences > 0 => trouble(format!("{heard}, no fix"), "give the antenna a free sky, and a minute"),
        _ => trouble(format!("{heard}, nothing understood"), "see that position.baud is the receiver's"),
    }
}

/// What is there and not asked.
fn unused(config: &PositionConfig) -> String {
    let mut there: Vec<_> = ["/dev/ttyACM0", "/dev/ttyUSB0"].into_iter().filter(|path| exists(path)).collect();
    if TcpStream::connect_timeout(&config.gpsd, KNOCKING).is_ok() {
        there.push("gpsd");
    }
    let there = if there.is_empty() { "nothing that could be a receiver is there".into() } else { there.join(", ") };
    format!("by speed alone, plants get no place on Earth; {there}")
}

fn exists(path: &str) -> bool {
    std::path::Path::new(path).exists()
}
