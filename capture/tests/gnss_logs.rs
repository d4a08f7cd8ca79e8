//! Real receivers' logs (../shared/data/gnss, with what gpsd makes of them): every sentence is taken, every fix agrees.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use demeter_capture::{Fix, PositionHealth, Quality, Receiver, ReceiverSettings, ReceiverSource};
use serde_json::Value;

/// Sentences with a good checksum. Logs hold other protocols as well, so they are looked for in bytes.
fn sentences(bytes: &[u8]) -> Vec<String> {
    let sentence = |line: &[u8]| {
        let start = line.iter().rposition(|byte| *byte == b'$')?;
        let text = String::from_utf8(line[start + 1..].trim_ascii().to_vec()).ok()?;
        let (body, sum) = text.rsplit_once('*')?;
        let found = body.bytes().fold(0, |sum, byte| sum ^ byte);
        (u8::from_str_radix(sum, 16).ok()? == found).then(|| body.to_owned())
    };
    bytes.split(|byte| *byte == b'\n').filter_map(sentence).collect()
}

/// What a receiver makes of a source, once it has been quiet for a while.
fn read(source: ReceiverSource) -> (PositionHealth, Vec<Fix>) {
    let receiver = Receiver::open(ReceiverSettings { source, latency: Duration::ZERO }).expect("a thread");
    let positions = receiver.positions();
    let health = || positions.health().expect("a receiver");
    let (started, mut before) = (Instant::now(), health());
    loop {
        std::thread::sleep(Duration::from_millis(500));
        let now = health();
        let heard = now.sentences + now.faults.values().sum::<u64>() > 0;
        if heard && (now.sentences, &now.faults) == (before.sentences, &before.faults) {
            return (now, positions.since(0));
        }
        assert!(started.elapsed() < Duration::from_secs(60), "{now:?}");
        before = now;
    }
}

/// gpsd's reports with a position, the last of each time.
fn expected(check: &str) -> (usize, BTreeMap<String, Value>) {
    let reports = check.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let fixes: Vec<_> =
        reports.filter(|r| r["class"] == "TPV" && r["mode"].as_u64() > Some(1) && r["lat"].is_f64()).collect();
    let timed = fixes
        .iter()
        .filter_map(|r| Some((r["time"].as_str()?.parse::<jiff::Timestamp>().ok()?.to_string(), r.clone())));
    (fixes.len(), timed.collect())
}

fn agree(fix: &Fix, told: &Value) {
    let near = |key: &str, found: Option<f64>, tolerance: f64| {
        if let (Some(told), Some(found)) = (told[key].as_f64(), found) {
            assert!((told - found).abs() <= tolerance, "{key}: expected {told}, found {fix:?}");
        }
    };
    // Five digits of a minute are 2 cm; gpsd may have had the place from another protocol, to the millimetre.
    near("lat", Some(fix.latitude_deg), 2e-7);
    near("lon", Some(fix.longitude_deg), 2e-7);
    near("altHAE", fix.altitude_m, 0.2);
    let quality = match told["status"].as_u64() {
        Some(2) => Quality::Differential,
        Some(3) => Quality::RtkFixed,
        Some(4) => Quality::RtkFloat,
        Some(5 | 6 | 8) => Quality::Estimated,
        _ => Quality::Autonomous,
    };
    assert_eq!(fix.quality, quality, "{told}");
}

fn logs(shared: &Path) -> Vec<PathBuf> {
    let files =
        fs::read_dir(shared.join("data/gnss")).expect("../shared/data/gnss").map(|file| file.expect("a file").path());
    let mut logs: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "log")).collect();
    logs.sort();
    assert!(!logs.is_empty());
    logs
}

#[test]
fn every_sentence_of_real_logs_is_taken_and_every_fix_is_where_gpsd_has_it() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    if !shared.exists() {
        eprintln!(
            "SKIPPED every_sentence_of_real_logs_is_taken_and_every_fix_is_where_gpsd_has_it: ../shared is absent"
        );
        return;
    }
    for log in logs(&shared) {
        let name = log.display();
        let check = fs::read_to_string(format!("{name}.chk")).expect("its .chk");
        let (told, by_time) = expected(&check);
        let whole = sentences(&fs::read(&log).expect("the log"));
        // gpsd's own list of sentences has all of them, and those it makes of other protocols.
        let listed: BTreeSet<_> = sentences(check.as_bytes()).into_iter().collect();
        assert!(whole.iter().all(|sentence| listed.contains(sentence)), "{name}");

        let (health, fixes) = read(ReceiverSource::Nmea { path: log.clone(), baud: 9600 });
        assert_eq!(health.sentences, whole.len() as u64, "{name}: {:?}", health.faults);
        // Other protocols are noise, and a log of several pieces jumps. Where RMC comes first it gives the first fix, and
        // the GGA of the same moment comes too late.
        let faults = health.faults.keys().filter(|fault| !["noise", "half_line", "time_jump"].contains(fault));
        let stale = health.faults.get("stale_time").copied().unwrap_or(0);
        assert!(faults.count() as u64 == stale && stale <= 1, "{name}: {:?}", health.faults);
        let placed = |body: &&String| {
            let fields: Vec<_> = body.split(',').collect();
            fields[0].ends_with("GGA") && fields[2..6].iter().all(|field| !field.is_empty()) && fields[6] != "0"
        };
        assert_eq!(fixes.len(), whole.iter().filter(placed).count(), "{name}");
        let matched = fixes.iter().filter_map(|fix| Some((fix, by_time.get(&fix.time?.to_string())?)));
        let matched = matched.inspect(|(fix, told)| agree(fix, told)).count();
        // The first comes before the sentence with the date; gpsd leaves one out now and then.
        assert!(matched * 100 >= fixes.len() * 90, "{name}: {matched} of {} fixes compared", fixes.len());

        // The same reports as gpsd sends them.
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("its number");
        std::thread::spawn(move || {
            let (mut client, _) = listener.accept().expect("the receiver");
            let reports = check.lines().filter(|line| line.starts_with('{'));
            reports.for_each(|line| writeln!(client, "{line}").expect("it reads"));
            std::thread::sleep(Duration::from_secs(20));
        });
        let (health, fixes) = read(ReceiverSource::Gpsd(address));
        let taken = health.fixes + health.faults.get("stale_time").copied().unwrap_or(0);
        assert_eq!(taken, told as u64, "{name}: {:?}", health.faults);
        for fix in &fixes {
            let Some(time) = fix.time else { continue };
            agree(fix, &by_time[&time.to_string()]);
        }
        eprintln!("{name}: {} sentences, {} fixes of {told} reports, {:?}", whole.len(), fixes.len(), health.faults);
    }
}
