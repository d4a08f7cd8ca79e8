//! reliability.md 20, `clock`: whatever the wall clock does, frames and plants stay in order, and a time is trusted only
//! once something that knows the time has set the clock.
#![allow(clippy::unwrap_used)]

mod common;

use std::num::NonZeroUsize;
use std::os::unix::fs::PermissionsExt;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use common::daemon::{Daemon, configure};
use common::{Bench, bench, row};
use demeter::clock::{Clock, Moment, wall_time};
use demeter::config::ModelsConfig;
use demeter::eye::Eye;
use demeter::pipeline::{self, Control, Progress, Run};
use demeter_capture::{Source, SourceError};
use demeter_frame::{Frame, Stamp};
use jiff::{SignedDuration, Timestamp};
use rusqlite::Connection;

/// Ten years, seconds.
const TEN_YEARS: i64 = 315_576_000;
/// Time from frame to frame, nanoseconds.
const FRAME_NS: u64 = 200_000_000;

/// A clock that tests set: how far the wall is from 1970 at the boot, and whether it is synchronised.
#[derive(Debug, Default)]
struct FakeClock(Mutex<(u64, i64, bool)>);

impl FakeClock {
    fn set(&self, mono_ns: u64, offset_seconds: i64, synchronised: bool) {
        *self.0.lock().unwrap() = (mono_ns, offset_seconds, synchronised);
    }

    fn stamp(&self) -> Stamp {
        let Moment { mono_ns, wall } = self.now();
        Stamp { mono_ns, wall: wall.to_string(), boot_id: self.boot_id().into() }
    }
}

impl Clock for FakeClock {
    fn now(&self) -> Moment {
        let (mono_ns, offset, _) = *self.0.lock().unwrap();
        let wall = Timestamp::new(offset, 0).unwrap() + SignedDuration::from_nanos(mono_ns as i64);
        Moment { mono_ns, wall }
    }

    fn boot_id(&self) -> &str {
        "boot"
    }

    fn synchronised(&self) -> bool {
        self.0.lock().unwrap().2
    }
}

#[test]
fn clock_times_of_frames_taken_before_it_was_set_are_right_once_it_is() {
    let clock = FakeClock::default();
    clock.set(5 * FRAME_NS, 0, false);
    let stamp = clock.stamp();
    assert_eq!(stamp.wall, "1970-01-01T00:00:01Z");
    assert_eq!(wall_time(&clock, &stamp), (stamp.wall.clone(), false));
    clock.set(10 * FRAME_NS, 3 * TEN_YEARS, false);
    assert_eq!(wall_time(&clock, &stamp), (stamp.wall.clone(), false), "a jump alone is no reason to trust");
    clock.set(10 * FRAME_NS, 5 * TEN_YEARS, true);
    assert_eq!(wall_time(&clock, &stamp), ("2020-01-01T12:00:01Z".into(), true));
    let other_boot = Stamp { boot_id: "before".into(), ..stamp.clone() };
    assert_eq!(wall_time(&clock, &other_boot), (stamp.wall.clone(), false), "another boot's time does not compare");
    let ahead = Stamp { mono_ns: u64::MAX, ..stamp };
    assert!(!wall_time(&clock, &ahead).1);
}

/// A live rig before a row, whose clock jumps. It gives a frame when the one before is through, so that none is dropped.
struct Jumping<'a> {
    row: demeter::synthetic::Synthetic,
    clock: &'a FakeClock,
    jump: fn(u64) -> (i64, bool),
    given: u64,
    through: &'a AtomicU64,
}

impl Source for Jumping<'_> {
    fn next(&mut self) -> Result<Option<Frame>, SourceError> {
        while self.through.load(Ordering::Relaxed) < self.given {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let (offset, synchronised) = (self.jump)(self.given);
        self.clock.set((1 + self.given) * FRAME_NS, offset, synchronised);
        self.given += 1;
        Ok(self.row.next()?.map(|frame| Frame { stamp: self.clock.stamp(), ..frame }))
    }
}

/// Three plants seen by a rig with that clock, as a live run stores them.
fn seen(jump: fn(u64) -> (i64, bool)) -> Bench {
    let bench = bench();
    let (row, manifest) = row(&bench.species, 3, "clock");
    let (clock, through, control) = (FakeClock::default(), AtomicU64::new(0), Control::default());
    let mut source = Jumping { row, clock: &clock, jump, given: 0, through: &through };
    let mut eye = Eye::open(&ModelsConfig::default(), NonZeroUsize::MIN).unwrap();
    let run = Run {
        manifest: &manifest,
        species: &bench.species,
        store: &bench.store,
        control: &control,
        clock: &clock,
        live: true,
    };
    let outcome = pipeline::run(&run, &mut source, &mut eye, |progress| {
        if matches!(progress, Progress::Frame) {
            through.fetch_add(1, Ordering::Relaxed);
        }
    });
    let outcome = outcome.unwrap();
    assert!(!outcome.is_partial() && control.dropped() == 0, "{outcome:?}");
    assert_eq!(outcome.plants, 3);
    bench
}

/// Each plant's record, time, whether that is trusted, and the numbers of its frames, in the order of storing.
fn stored(bench: &Bench) -> Vec<(Vec<u8>, Timestamp, bool, Vec<u64>)> {
    let connection = Connection::open(&bench.path).unwrap();
    let frames = "(SELECT json_group_array(frame) FROM observations WHERE plant = seq)";
    let sql = format!("SELECT record, time, time_trusted, {frames} FROM plants ORDER BY seq");
    let mut statement = connection.prepare(&sql).unwrap();
    let row = |row: &rusqlite::Row<'_>| {
        let (time, frames): (String, String) = (row.get(1)?, row.get(3)?);
        let mut frames: Vec<u64> = serde_json::from_str(&frames).unwrap();
        frames.sort_unstable();
        Ok((row.get(0)?, time.parse().unwrap(), row.get(2)?, frames))
    };
    statement.query_map([], row).unwrap().collect::<Result<_, _>>().unwrap()
}

#[test]
fn clock_that_starts_in_1970_and_jumps_ten_years_changes_no_record_and_no_order() {
    let steady = stored(&seen(|_| (5 * TEN_YEARS, true)));
    let jumping = stored(&seen(|frame| match frame {
        0..4 => (0, false),
        4..8 => (TEN_YEARS, false),
        _ => (-TEN_YEARS, false),
    }));
    let records = |plants: &[(Vec<u8>, _, _, Vec<u64>)]| {
        plants.iter().map(|plant| (plant.0.clone(), plant.3.clone())).collect::<Vec<_>>()
    };
    assert_eq!(records(&steady), records(&jumping), "a clock reached a record, or the frames of a plant");
    // The frames of each plant, and the plants by their last frame, in the order of the camera.
    let last: Vec<_> = jumping.iter().map(|plant| plant.3.last().unwrap()).collect();
    assert!(last.is_sorted(), "{last:?}");
    assert!(jumping.iter().all(|plant| !plant.2), "a clock that nobody set was trusted");
    assert!(jumping.iter().any(|plant| plant.1 < Timestamp::UNIX_EPOCH), "the clock did jump");

    let start = Timestamp::new(5 * TEN_YEARS, 0).unwrap();
    for (_, time, trusted, frames) in &steady {
        let taken = |frame: &u64| start + SignedDuration::from_nanos(((1 + frame) * FRAME_NS) as i64);
        assert!(*trusted && frames.iter().any(|frame| taken(frame) == *time), "{time} of {frames:?}");
    }
}

#[test]
fn clock_that_is_set_on_the_way_gives_right_times_to_plants_seen_before() {
    let start = Timestamp::new(5 * TEN_YEARS, 0).unwrap();
    // The last frame comes with a clock that is set; the last plant was seen best before it.
    let plants = stored(&seen(|frame| if frame < 11 { (0, false) } else { (5 * TEN_YEARS, true) }));
    let (_, time, trusted, frames) = plants.last().unwrap();
    let taken = |frame: &u64| start + SignedDuration::from_nanos(((1 + frame) * FRAME_NS) as i64);
    assert!(*trusted && frames.iter().any(|frame| taken(frame) == *time), "{time} of {frames:?}");
    // Those that were stored before keep the time that the box believed, and say so.
    assert!(plants.iter().all(|plant| plant.2 == (plant.1 >= start)), "{plants:?}");
}

#[test]
fn clock_is_trusted_by_the_daemon_when_systemd_says_that_it_is_synchronised() {
    for (answer, trusted) in [("yes", true), ("no", false), ("", false)] {
        let folder = tempfile::tempdir().unwrap();
        configure(folder.path(), "");
        let fake = folder.path().join("timedatectl");
        std::fs::write(&fake, format!("#!/bin/sh\necho '{answer}'\necho \"$@\" >> asked\n")).unwrap();
        std::fs::set_permissions(&fake, std::fs::Permissions::from_mode(0o755)).unwrap();
        let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap());
        let daemon = Daemon::start_with(folder.path(), |command| {
            command.env("PATH", path);
        });
        let asked = folder.path().join("asked");
        // The shell makes the file before it writes.
        let is_asked = || std::fs::read_to_string(&asked).is_ok_and(|said| said.ends_with('\n'));
        let status = daemon.wait_for(|status| is_asked() && (!trusted || status["time_trusted"] == true));
        assert_eq!(status["time_trusted"], trusted, "`{answer}`");
        assert_eq!(
            std::fs::read_to_string(asked).unwrap().lines().next(),
            Some("show --property=NTPSynchronized --value")
        );
    }
}
