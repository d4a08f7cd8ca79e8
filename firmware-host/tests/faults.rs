//! What the daemon promises in seconds and bytes. Asserted in `make faults` alone: release build, nothing beside it.
#![allow(clippy::unwrap_used)]

mod common;

use std::time::{Duration, Instant};

use common::daemon::{Daemon, LONG, configure, configured};

#[test]
#[ignore = "asserts times: make faults"]
fn ready_within_a_second() {
    let bench = configured(1000, LONG);
    let start = |_| {
        let started = Instant::now();
        let daemon = Daemon::start(bench.folder.path());
        let taken = started.elapsed();
        daemon.signal("KILL");
        taken
    };
    let slowest = (0..20).map(start).max().unwrap();
    eprintln!("start to READY, the slowest of 20 with 1000 plants in the store: {slowest:?}");
    assert!(slowest <= Duration::from_secs(1), "{slowest:?}");
}

#[test]
#[ignore = "asserts times: make faults"]
fn a_stop_leaves_a_clean_store_within_five_seconds() {
    let mut slowest = Duration::ZERO;
    for after in 0..10 {
        let bench = configured(0, LONG);
        let daemon = Daemon::start(bench.folder.path());
        daemon.wait_for(|status| status["store"]["plants"].as_u64() > Some(0));
        std::thread::sleep(Duration::from_millis(130 * after));
        let asked = Instant::now();
        daemon.signal(if after % 2 == 0 { "PWR" } else { "TERM" });
        assert_eq!(daemon.ended(), Some(0));
        slowest = slowest.max(asked.elapsed());
        let log = bench.path.with_extension("sqlite-wal");
        assert!(!log.exists() || log.metadata().unwrap().len() == 0);
        bench.assert_whole();
    }
    eprintln!("SIGPWR or SIGTERM to the end, the slowest of 10 in the middle of work: {slowest:?}");
    assert!(slowest <= Duration::from_secs(5), "{slowest:?}");
}

#[test]
#[ignore = "asserts times: make faults"]
fn thermal_sheds_load_within_five_seconds() {
    let bench = configured(0, "");
    let zone = bench.folder.path().join("thermal/thermal_zone0");
    std::fs::create_dir_all(&zone).unwrap();
    std::fs::write(zone.join("temp"), "50000").unwrap();
    configure(bench.folder.path(), &format!("[thermal]\nfolder = '{}'\n{LONG}", zone.parent().unwrap().display()));
    let daemon = Daemon::start(bench.folder.path());
    daemon.wait_for(|status| status["heat"]["celsius"] == 50.0);
    let heated = Instant::now();
    std::fs::write(zone.join("temp"), "90000").unwrap();
    daemon.wait_for(|status| status["heat"]["slowness"].as_u64() > Some(1));
    eprintln!("hot to less work: {:?}", heated.elapsed());
    assert!(heated.elapsed() <= Duration::from_secs(5), "{:?}", heated.elapsed());
}

#[test]
#[ignore = "asserts memory: make faults"]
fn memory_stays_within_400_mib() {
    let bench = configured(0, LONG);
    let daemon = Daemon::start(bench.folder.path());
    daemon.wait_for(|status| status["store"]["plants"].as_u64() > Some(20));
    let most = daemon.most_memory();
    eprintln!("most memory after 20 plants: {} MiB", most >> 20);
    assert!(most <= 400 << 20, "{most}");
}
