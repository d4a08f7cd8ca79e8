//! reliability.md 26, `thermal`: a hot box sheds load soon, and does not stop and go about it.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;
use std::time::{Duration, Instant};

use common::bench;
use common::daemon::{Daemon, configure};
use demeter::config::ThermalConfig;
use demeter::daemon::thermal::Thermal;

/// A fake /sys/class/thermal whose hottest zone says this.
fn heat(folder: &Path, text: &str) {
    for (zone, text) in [("thermal_zone0", "31000\n"), ("thermal_zone1", text)] {
        std::fs::create_dir_all(folder.join(zone)).unwrap();
        std::fs::write(folder.join(zone).join("temp"), text).unwrap();
    }
    std::fs::create_dir_all(folder.join("cooling_device0")).unwrap();
}

/// What a governor with the default thresholds (80 and 70 °C) makes of each second's temperature.
fn governed(celsius: impl IntoIterator<Item = f64>) -> Vec<u32> {
    let folder = tempfile::tempdir().unwrap();
    let mut thermal = Thermal::new(ThermalConfig { folder: folder.path().into(), ..ThermalConfig::default() });
    let start = Instant::now();
    let second = |(second, celsius)| {
        heat(folder.path(), &format!("{:.0}\n", celsius * 1e3));
        thermal.update(start + Duration::from_secs(second)).slowness
    };
    (0..).zip(celsius).map(second).collect()
}

#[test]
fn thermal_load_is_shed_within_five_seconds_and_further_while_it_stays_hot() {
    let steps = governed([60.0; 10].into_iter().chain([85.0; 20]));
    assert_eq!(steps[..10], [1; 10]);
    assert!(steps[10..15].iter().any(|slowness| *slowness > 1), "{steps:?}");
    assert!(steps[10..].is_sorted());
    assert_eq!(steps.last(), Some(&8));
}

#[test]
fn thermal_steps_do_not_follow_a_temperature_that_wavers() {
    // Between the thresholds nothing changes, whichever way it came there.
    let between = || (0..300).map(|second| 75.0 + 4.9 * f64::from(second).sin());
    assert!(governed(between()).iter().all(|slowness| *slowness == 1));
    let after = governed(std::iter::once(81.0).chain(between()));
    assert!(after.iter().all(|slowness| *slowness == 2), "{after:?}");
    // Over a threshold and back each second: no more changes than the box can answer.
    let wild: Vec<_> = (0..300).map(|second| if second % 2 == 0 { 85.0 } else { 65.0 }).collect();
    let changes = governed(wild).windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes <= 3, "{changes} changes in five minutes");
}

#[test]
fn thermal_load_is_taken_up_again_slowly_once_it_is_cool() {
    let steps = governed([85.0; 10].into_iter().chain([50.0; 200]));
    let cooling = &steps[10..];
    assert!(cooling.windows(2).all(|pair| pair[0] >= pair[1]), "{cooling:?}");
    assert_eq!(cooling.last(), Some(&1));
    let longest = cooling.chunk_by(PartialEq::eq).map(<[u32]>::len).min();
    assert!(longest >= Some(20), "{cooling:?}");
}

#[test]
fn thermal_sensors_that_are_broken_or_gone_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut thermal = Thermal::new(ThermalConfig { folder: folder.path().into(), ..ThermalConfig::default() });
    let (mut now, second) = (Instant::now(), Duration::from_secs(1));
    let mut update = |thermal: &mut Thermal| {
        now += 10 * second;
        thermal.update(now)
    };
    assert_eq!(update(&mut thermal).celsius, None);
    for rubbish in ["", "hot\n", "-274000\n", "999999999\n", "NaN\n", "inf\n"] {
        heat(folder.path(), rubbish);
        let heat = update(&mut thermal);
        assert_eq!((heat.celsius, heat.slowness), (Some(31.0), 1), "{rubbish}");
    }
    heat(folder.path(), "90000\n");
    assert_eq!(update(&mut thermal).slowness, 2);
    std::fs::remove_dir_all(folder.path()).unwrap();
    let gone = update(&mut thermal);
    assert_eq!((gone.celsius, gone.slowness), (None, 2), "what was shed stays shed");
}

#[test]
fn thermal_daemon_sheds_load_says_so_and_loses_no_plant() {
    let bench = bench();
    let sensors = bench.folder.path().join("thermal");
    heat(&sensors, "95000\n");
    let more = format!(
        "[thermal]\nfolder = '{}'\n[source]\nkind = 'synthetic'\nplants = 2\nspecies = 'soybean'\n",
        sensors.display()
    );
    configure(bench.folder.path(), &more);
    let daemon = Daemon::start(bench.folder.path());
    let status = daemon.wait_for(|status| status["heat"]["slowness"].as_u64() > Some(1));
    assert_eq!((&status["health"], &status["reasons"][0]["kind"]), (&"degraded".into(), &"hot".into()), "{status}");
    assert_eq!(status["heat"]["celsius"], 95.0);
    let done = daemon.wait_for(|status| status["activity"]["state"] == "finished");
    assert_eq!(done["store"]["plants"], 2);
}
