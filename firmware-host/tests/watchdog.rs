//! reliability.md 27, `watchdog`: READY after the store opens (tests/daemon.rs), and a frozen stage stops the pings.
#![allow(clippy::unwrap_used)]

mod common;

use std::num::NonZeroUsize;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use common::daemon::{Daemon, configure};
use common::{bench, row};
use demeter::clock::SystemClock;
use demeter::config::ModelsConfig;
use demeter::daemon::watchdog::{STUCK, StoreBeat, alive, stages};
use demeter::eye::Eye;
use demeter::pipeline::{self, Control, Progress, Run};

#[test]
fn watchdog_pings_come_while_everything_moves() {
    let folder = tempfile::tempdir().unwrap();
    configure(folder.path(), "");
    let daemon = Daemon::start(folder.path());
    for _ in 0..3 {
        assert_eq!(daemon.told(), "WATCHDOG=1");
    }
    // Reading the configuration again does not end them, and an end is told.
    daemon.signal("HUP");
    daemon.signal("TERM");
    let told: Vec<_> = std::iter::repeat_with(|| daemon.told()).take_while(|told| told != "STOPPING=1").collect();
    assert!(told.iter().all(|told| ["WATCHDOG=1", "RELOADING=1", "READY=1"].contains(&told.as_str())), "{told:?}");
    assert_eq!(daemon.ended(), Some(0));
}

#[test]
fn watchdog_pings_stop_for_a_stage_that_is_frozen_and_not_for_those_that_wait_for_it() {
    let bench = bench();
    let (mut source, manifest) = row(&bench.species, 2, "watchdog");
    let mut eye = Eye::open(&ModelsConfig::default(), NonZeroUsize::MIN).unwrap();
    let (control, clock) = (Control::default(), SystemClock::new());
    let run = Run {
        manifest: &manifest,
        species: &bench.species,
        store: &bench.store,
        control: &control,
        clock: &clock,
        live: false,
    };
    let started = Instant::now();
    let store_beat = StoreBeat::new(started);
    let is_alive = |now| alive(&stages(&control, now), &store_beat, now);
    assert!(is_alive(started), "nothing runs yet");

    let (frozen, is_frozen) = mpsc::channel();
    let (thaw, thawed) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        let (run, source, eye) = (&run, &mut source, &mut eye);
        let running = scope.spawn(move || {
            // The last stage hangs at its first frame, until it is let go.
            pipeline::run(run, source, eye, |progress| {
                if matches!(progress, Progress::Frame) && frozen.send(()).is_ok() {
                    thawed.recv().ok();
                }
            })
        });
        is_frozen.recv().unwrap();
        drop(is_frozen);
        // The others run until the queues are full, and wait then.
        let waits = |index: usize| stages(&control, Instant::now())[index].busy_seconds.is_none();
        while !(waits(0) && waits(1)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        let later = Instant::now() + STUCK + Duration::from_secs(1);
        let stuck: Vec<_> = stages(&control, later).into_iter().filter(|stage| stage.stuck).collect();
        assert_eq!(stuck.iter().map(|stage| stage.name).collect::<Vec<_>>(), ["keeper"]);
        assert!(is_alive(Instant::now()), "not frozen for long enough");
        let mut answering = StoreBeat::new(later);
        answering.answer(true, later);
        assert!(!alive(&stages(&control, later), &answering, later));
        thaw.send(()).unwrap();
        assert!(running.join().unwrap().unwrap().plants > 0);
    });
    let later = Instant::now() + STUCK * 100;
    assert!(stages(&control, later).iter().all(|stage| !stage.stuck), "a stage that waits for work is alive");
}

#[test]
fn watchdog_pings_stop_for_a_store_that_is_silent() {
    let start = Instant::now();
    let mut store = StoreBeat::new(start);
    assert!(store.ask() && !store.ask(), "one question at a time");
    store.answer(true, start + Duration::from_secs(10));
    assert!(alive(&[], &store, start + STUCK + Duration::from_secs(10)));
    assert!(!alive(&[], &store, start + STUCK + Duration::from_secs(11)));
    assert!(store.ask());
    store.answer(false, start + STUCK + Duration::from_secs(11));
    assert!(!alive(&[], &store, start + STUCK + Duration::from_secs(11)), "an error is no answer");
    store.answer(true, start + STUCK + Duration::from_secs(12));
    assert!(alive(&[], &store, start + STUCK + Duration::from_secs(12)));
}
