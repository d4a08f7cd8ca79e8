use std::io::Write;
use std::net::TcpListener;
use std::time::{Duration, Instant};

use demeter_frame::Stamp;
use proptest::prelude::*;

use super::lines::Lines;
use super::receiver::Dialect;
use super::*;

const SECOND: u64 = 1_000_000_000;

/// A sentence with its frame around it.
fn framed(body: &str) -> String {
    format!("${body}*{:02X}", body.bytes().fold(0, |sum, byte| sum ^ byte))
}

fn nmea() -> Dialect {
    Dialect::of(&ReceiverSource::Nmea { path: "/dev/null".into(), baud: 9600 })
}

/// What sentences come to, a tenth of a second apart.
fn said(bodies: &[&str]) -> Vec<Result<Option<Fix>, Fault>> {
    let mut dialect = nmea();
    let read = |(i, body): (usize, &&str)| dialect.read(framed(body).as_bytes(), i as u64 * SECOND / 10);
    bodies.iter().enumerate().map(read).collect()
}

const GGA: &str = "GNGGA,132820.20,4134.49807884,N,09345.03400297,W,4,10,0.9,278.230,M,-31.442,M,7.2,0133";
const RMC: &str = "GNRMC,132820.20,A,4134.49807884,N,09345.03400297,W,2.0,118.806,180320,11.5985,E,D";

#[test]
fn a_fix_has_its_place_kind_motion_and_accuracy_from_the_sentences_that_know_them() {
    let fixes = said(&[RMC, "GNGST,132820.20,,,,,0.03,0.04,0.05", GGA]);
    let fix = fixes[2].clone().unwrap().unwrap();
    assert_eq!((fix.quality, fix.t_mono_ns), (Quality::RtkFixed, SECOND / 5));
    assert!((fix.latitude_deg - 41.574_967_981).abs() < 1e-9 && (fix.longitude_deg + 93.750_566_716).abs() < 1e-9);
    assert!((fix.altitude_m.unwrap() - 246.788).abs() < 1e-3, "above the ellipsoid: {:?}", fix.altitude_m);
    assert!((fix.speed_m_per_s.unwrap() - 1.0289).abs() < 1e-4 && (fix.course_deg.unwrap() - 118.806).abs() < 1e-3);
    assert!((fix.accuracy_m.unwrap() - 0.05).abs() < 1e-6 && (fix.altitude_accuracy_m.unwrap() - 0.05).abs() < 1e-6);
    assert_eq!(fix.time.unwrap().to_string(), "2020-03-18T13:28:20.2Z");
    // RMC gave its own position because no GGA had come; from then on it gives the motion alone.
    assert_eq!(fixes[0].as_ref().unwrap().as_ref().unwrap().quality, Quality::Differential);
    assert_eq!(said(&[GGA, RMC])[1], Ok(None));
    assert_eq!(said(&[GGA, GGA])[1], Err(Fault::StaleTime), "a receiver that repeats itself has lost its fix");
    // Without GST the accuracy is guessed from the kind and the geometry.
    let guessed = said(&[GGA])[0].clone().unwrap().unwrap();
    assert!((guessed.accuracy_m.unwrap() - 0.0135).abs() < 1e-6 && guessed.speed_m_per_s.is_none());
}

#[test]
fn what_is_no_use_is_told_by_its_reason() {
    let whole = framed(GGA);
    let cases = [
        (whole.replace("4134", "4135"), Err(Fault::Checksum)),
        (whole[..40].to_owned(), Err(Fault::Half)),
        (format!("{whole}7"), Err(Fault::Half)),
        (whole.replace('$', "#"), Err(Fault::Noise)),
        (framed(&GGA.replace("4134.49807884", "9134.49807884")), Err(Fault::Value)),
        (framed(&GGA.replace("4134.49807884", "41nan")), Err(Fault::Value)),
        (framed(&GGA.replace("278.230", "nan")), Err(Fault::Value)),
        (framed(&GGA.replace("278.230", "inf")), Err(Fault::Value)),
        (framed(&GGA.replace("132820.20", "996199.20")), Err(Fault::Value)),
        (framed("GNGGA"), Err(Fault::Value)),
        (framed("GNGGA,132820.20,,,,,0,00,99.9,,,,,,"), Ok(None)),
        (framed("PUBX,00,whatever"), Ok(None)),
        (framed("GPGSV,3,1,11,04"), Ok(None)),
        (framed(&GGA.replace("W,4,", "W,0,")), Ok(None)),
    ];
    for (line, expected) in cases {
        assert_eq!(nmea().read(line.as_bytes(), 0), expected, "{line}");
    }
    for (line, expected) in [
        (r#"{"class":"TPV","mode":3,"lat":1.0,"lon":2"#, Err(Fault::Half)),
        (r#"{"class":"TPV","mode":3,"lat":nan,"lon":2}"#, Err(Fault::Noise)),
        (r#"{"class":"TPV","mode":3,"lat":"1","lon":2}"#, Err(Fault::Value)),
        (r#"{"class":"TPV","mode":3,"lat":91,"lon":2}"#, Err(Fault::Value)),
        (r#"{"class":"TPV","mode":3,"time":"yesterday","lat":1,"lon":2}"#, Err(Fault::Value)),
        (r#"{"class":"TPV","mode":1,"lat":1,"lon":2}"#, Ok(None)),
        (r#"{"class":"SKY","satellites":[{"PRN":1}]}"#, Ok(None)),
        (r#"{"class":"VERSION","release":"3.25"}"#, Ok(None)),
        ("$GPGGA", Err(Fault::Noise)),
    ] {
        assert_eq!(gpsd::read(line.as_bytes(), 0), expected, "{line}");
    }
}

#[test]
fn repeated_and_jumping_times_are_counted_and_only_repeated_ones_refused() {
    let positions = Positions::of_receiver("test".into(), "boot".into());
    let fix = |t: u64, time: &str| {
        let fix = said(&[GGA])[0].clone().unwrap().unwrap();
        positions.take(Ok(Some(Fix { t_mono_ns: t * SECOND, time: time.parse().ok(), ..fix })));
        let health = positions.health().unwrap();
        (health.fixes, health.faults.get("stale_time").copied(), health.faults.get("time_jump").copied())
    };
    assert_eq!(fix(1, "2026-06-01T10:00:00Z"), (1, None, None));
    assert_eq!(fix(2, "2026-06-01T10:00:00Z"), (1, Some(1), None), "the same again is no new fix");
    assert_eq!(fix(3, "2026-06-01T09:59:58Z"), (1, Some(2), None));
    assert_eq!(fix(4, "2026-06-01T10:00:03Z"), (2, Some(2), None));
    assert_eq!(fix(5, "2046-06-01T10:00:03Z"), (3, Some(2), Some(1)));
    assert_eq!(fix(6, "2026-06-01T10:00:05Z"), (4, Some(2), Some(2)), "back again");
    assert_eq!(fix(7, "no time"), (5, Some(2), Some(2)));
}

#[test]
fn between_fixes_is_a_straight_line_and_a_lost_fix_is_a_gap() {
    let positions = Positions::default();
    let fix = said(&[RMC, GGA])[1].clone().unwrap().unwrap();
    for (t, latitude, longitude, course) in [(10, 50.0, 179.9, 350.0), (12, 50.2, -179.9, 10.0), (20, 51.0, 0.0, 0.0)] {
        let fix = Fix {
            t_mono_ns: t * SECOND,
            latitude_deg: latitude,
            longitude_deg: longitude,
            course_deg: Some(course),
            quality: if t == 12 { Quality::RtkFloat } else { Quality::RtkFixed },
            ..fix.clone()
        };
        assert!(positions.replay(fix, "boot".into()));
    }
    assert!(!positions.replay(Fix { t_mono_ns: SECOND, ..fix }, "boot".into()), "time does not run back");
    let at = |mono_ns, boot: &str| positions.at(&Stamp { mono_ns, wall: String::new(), boot_id: boot.into() });
    let half = at(11 * SECOND, "boot").unwrap();
    assert!((half.latitude_deg - 50.1).abs() < 1e-9 && (half.longitude_deg.abs() - 180.0).abs() < 1e-9, "{half:?}");
    assert!(half.course_deg.unwrap().abs() < 1e-9 && half.quality == Quality::RtkFloat);
    assert_eq!(at(10 * SECOND, "boot").unwrap().latitude_deg, 50.0);
    for gap in [9 * SECOND, 12 * SECOND + 1, 16 * SECOND, 20 * SECOND + 1] {
        assert_eq!(at(gap, "boot"), None, "{gap}");
    }
    assert_eq!(at(11 * SECOND, "another"), None, "times of two boots do not compare");
}

#[test]
fn the_way_driven_goes_on_without_steps_and_ends_with_the_fixes() {
    let mut track = track::Track::default();
    let fix = said(&[RMC, GGA])[1].clone().unwrap().unwrap();
    for (t, speed) in [(10, 1.0), (11, 2.0), (12, 2.0)] {
        track.push(Fix { t_mono_ns: t * SECOND, speed_m_per_s: Some(speed), ..fix.clone() }, 2);
    }
    let driven = |tenths: u64| track.driven(tenths * SECOND / 10);
    assert_eq!([driven(120), driven(125), driven(119)], [Some(3.0), Some(4.0), Some(2.8)]);
    assert_eq!((driven(146), track.newest(9).len()), (None, 2));
}

/// Waits until the receiver is as wanted.
fn wait(positions: &Positions, wanted: impl Fn(&PositionHealth) -> bool) -> PositionHealth {
    let started = Instant::now();
    loop {
        let health = positions.health().unwrap();
        if wanted(&health) {
            return health;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "{health:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn receiver(source: ReceiverSource) -> Receiver {
    Receiver::open(ReceiverSettings { source, latency: Duration::ZERO }).unwrap()
}

#[test]
fn gpsd_is_asked_and_found_again_when_it_was_gone() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let receiver = receiver(ReceiverSource::Gpsd(address));
    let positions = receiver.positions();
    for second in 0..2 {
        let (mut client, _) = listener.accept().unwrap();
        let mut asked = [0; 7];
        std::io::Read::read_exact(&mut client, &mut asked).unwrap();
        assert_eq!(&asked, b"?WATCH=");
        let report = format!(
            r#"{{"class":"TPV","mode":3,"status":3,"time":"2026-06-01T10:00:0{second}Z","lat":50.5,"lon":7.5}}"#
        );
        // In two pieces, after a line of ten megabytes.
        for _ in 0..10 {
            client.write_all(&vec![b'x'; 1 << 20]).unwrap();
        }
        write!(client, "\n{}", &report[..30]).unwrap();
        client.flush().unwrap();
        write!(client, "{}\r\n", &report[30..]).unwrap();
        let health = wait(&positions, |health| health.fixes == second + 1);
        assert_eq!((health.state, health.faults["too_long"]), (PositionState::Fix, second + 1));
        drop(client);
        wait(&positions, |health| health.state == PositionState::Lost);
    }
    let fixes = positions.since(1);
    assert_eq!((fixes.len(), fixes[0].quality, fixes[0].latitude_deg), (1, Quality::RtkFixed, 50.5));
}

#[test]
fn a_pipe_without_a_writer_keeps_nobody_and_a_file_may_grow() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    rustix::fs::mknodat(rustix::fs::CWD, &pipe, rustix::fs::FileType::Fifo, 0o600.into(), 0).unwrap();
    drop(receiver(ReceiverSource::Nmea { path: pipe, baud: 9600 }));

    let path = folder.path().join("log");
    let missing = receiver(ReceiverSource::Nmea { path: path.clone(), baud: 9600 });
    let lost = wait(&missing.positions(), |health| health.state == PositionState::Lost);
    assert!(lost.last_error.unwrap().contains("No such file"));
    let mut log = std::fs::File::create(&path).unwrap();
    writeln!(log, "{}\r", framed("GNGGA,132820.10,,,,,0,00,99.9,,,,,,")).unwrap();
    wait(&missing.positions(), |health| health.state == PositionState::NoFix);
    writeln!(log, "{}\r", framed(GGA)).unwrap();
    wait(&missing.positions(), |health| health.state == PositionState::Fix);
    // A lost fix is no frozen position.
    wait(&missing.positions(), |health| health.state == PositionState::NoFix);
}

proptest! {
    /// Whatever bytes come down the line, in whatever pieces: nothing panics, and a fix is a place on Earth.
    #[test]
    fn no_bytes_do_harm(
        noise in proptest::collection::vec(any::<u8>(), 0..200),
        cut in 0..90usize,
        field in "[-+0-9.,eEnainfNSEWA*$]{0,12}",
        at in 7..80usize,
    ) {
        let mut body = GGA.to_owned();
        body.replace_range(at..(at + field.len()).min(body.len()), &field);
        let whole = framed(&body);
        let mut bytes = noise;
        bytes.extend_from_slice(&whole.as_bytes()[..cut.min(whole.len())]);
        bytes.extend_from_slice(b"\r\n");
        bytes.extend_from_slice(whole.as_bytes());
        bytes.push(b'\n');
        for piece in [1, 7, bytes.len()] {
            let (mut lines, mut dialect) = (Lines::default(), nmea());
            for bytes in bytes.chunks(piece) {
                lines.feed(bytes, |line| {
                    if let Ok(Some(fix)) = line.and_then(|line| dialect.read(line, 0)) {
                        assert_eq!(fix.wrong(), None);
                    }
                    let report = line.and_then(|line| gpsd::read(line, 0));
                    assert!(!matches!(report, Ok(Some(_))), "no report in there");
                });
            }
        }
    }
}
