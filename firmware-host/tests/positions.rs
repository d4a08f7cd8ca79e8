//! Positions from a recording to the plants' places on Earth: a rig that knows where it is, its session replayed.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;
use std::process::Command;

use common::{bench, row};
use demeter_capture::{Fix, Manifest, Quality, Recorder, Source};
use demeter_frame::Frame;
use glam::DVec2;
use rusqlite::Connection;
use serde_json::Value;

/// The world's x axis points so far from north, degrees; its origin lies at 50 degrees north, 7 degrees east.
const TURNED: f64 = 30.0;
/// Metres of a degree of latitude and of longitude there.
const DEGREE: [f64; 2] = [111_229.0, 71_696.0];
/// The cameras are so far from the antenna, metres: forwards, and to the left.
const ARM: [f64; 2] = [-1.5, 0.25];

/// Latitude and longitude of a point of the world.
fn on_earth(at: DVec2) -> [f64; 2] {
    let (sin, cos) = TURNED.to_radians().sin_cos();
    [50.0 + (at.x * cos + at.y * sin) / DEGREE[0], 7.0 + (at.x * sin - at.y * cos) / DEGREE[1]]
}

/// What an antenna on the rig gives at a frame, when the rig drives along the world's x axis.
fn fix(frame: &Frame) -> Fix {
    let camera = frame.world_from_camera.unwrap().translation.truncate();
    let [latitude_deg, longitude_deg] = on_earth(camera - DVec2::from(ARM));
    Fix {
        t_mono_ns: frame.stamp.mono_ns,
        boot_id: Some(frame.stamp.boot_id.clone()),
        time: "2026-06-01T10:00:00Z".parse().ok(),
        quality: Quality::RtkFixed,
        latitude_deg,
        longitude_deg,
        altitude_m: Some(120.5),
        accuracy_m: Some(0.02),
        altitude_accuracy_m: None,
        speed_m_per_s: Some(0.8),
        course_deg: Some(TURNED),
    }
}

/// Three plants as the rig saw them, with a fix at every frame but those of the last third.
fn record(folder: &Path) {
    let bench = bench();
    let (mut source, manifest) = row(&bench.species, 3, "placed");
    let manifest = Manifest { cameras_from_antenna_m: Some(ARM), ..manifest };
    let mut recorder = Recorder::create(folder, manifest).unwrap();
    while let Some(frame) = source.next().unwrap() {
        recorder.write(&frame).unwrap();
        if frame.seq < 8 {
            recorder.write_fix(&fix(&frame)).unwrap();
        }
    }
    recorder.finish().unwrap();
}

fn demeter(folder: &Path, arguments: &str) -> Vec<u8> {
    let output =
        Command::new(env!("CARGO_BIN_EXE_demeter")).args(arguments.split(' ')).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

#[test]
fn plants_lie_on_earth_where_the_rig_was_and_a_lost_fix_gives_no_place() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder.path().join("session"));
    for store in ["a.sqlite", "b.sqlite"] {
        demeter(folder.path(), &format!("replay session --db {store}"));
    }
    let bodies = |store: &str| -> Vec<Vec<u8>> {
        let store = Connection::open(folder.path().join(store)).unwrap();
        let mut statement = store.prepare("SELECT body FROM plants ORDER BY seq").unwrap();
        statement.query_map([], |row| row.get(0)).unwrap().map(Result::unwrap).collect()
    };
    assert_eq!(bodies("a.sqlite"), bodies("b.sqlite"), "positions and all");

    let geojson = demeter(folder.path(), "plants export --format geojson --db a.sqlite");
    let geojson: Value = serde_json::from_slice(&geojson).unwrap();
    let plants = geojson["features"].as_array().unwrap();
    let placed: Vec<_> = plants.iter().filter(|plant| !plant["geometry"].is_null()).collect();
    assert!(placed.len() >= 2 && placed.len() < plants.len(), "{placed:?} of {}", plants.len());
    for plant in placed {
        let number = |value: &Value| value.as_f64().unwrap();
        let position = &plant["properties"]["position"];
        let expected = on_earth(DVec2::new(number(&position[0]), number(&position[1])));
        let point = &plant["geometry"]["coordinates"];
        let off = [number(&point[1]) - expected[0], number(&point[0]) - expected[1]];
        // The rig wobbles a little, so its heading is not that of its last step.
        assert!(off.iter().zip(DEGREE).all(|(degrees, metres)| (degrees * metres).abs() < 0.1), "{off:?}");
    }
    let store = Connection::open(folder.path().join("a.sqlite")).unwrap();
    let provenance: String = store
        .query_row("SELECT provenance FROM plants WHERE latitude IS NOT NULL LIMIT 1", [], |row| row.get(0))
        .unwrap();
    let found: Value = serde_json::from_str(&provenance).unwrap();
    let expected = serde_json::json!({
        "quality": "rtk_fixed", "accuracy_m": 0.02, "altitude_m": 120.5, "heading_deg": TURNED
    });
    assert_eq!(found["position"], expected);
}
