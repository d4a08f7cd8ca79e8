//! The main line end to end: the bundled session becomes plants in SQLite, twice the same, and near its truth.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use demeter_capture::{Manifest, Pace, Recorder, Replay, SessionCamera, Source, decode};
use demeter_frame::{Calibration, Distortion, Frame, Rgb};
use demeter_tests::{answer, demeter, root};
use glam::DVec2;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::interpolate_bilinear;
use rusqlite::Connection;
use serde_json::Value;

fn fixture() -> PathBuf {
    root().join("tests/fixtures/row")
}

fn replay(session: &Path, db: &Path) -> (Option<i32>, Value) {
    answer(&["replay", session.to_str().unwrap(), "--db", db.to_str().unwrap(), "--speed", "max"])
}

/// Every plant's id, record, traits and provenance, as stored.
fn stored(db: &Path) -> Vec<(String, Vec<u8>, String, String)> {
    let connection = Connection::open(db).unwrap();
    let mut rows = connection.prepare("SELECT id, record, traits, provenance FROM plants ORDER BY seq").unwrap();
    rows.query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)))
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap()
}

#[test]
fn the_bundled_session_becomes_its_plants_and_two_replays_agree_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("1.sqlite"), folder.path().join("2.sqlite"));
    let (code, replayed) = replay(&fixture(), &first);
    assert_eq!(code, Some(0), "{replayed}");
    assert_eq!(replay(&fixture(), &second).0, Some(0));
    let plants = stored(&first);
    assert_eq!(plants, stored(&second), "no clock, thread or hash map may reach a record");
    let printed: Vec<&str> = replayed["plants"].as_array().unwrap().iter().map(|p| p["id"].as_str().unwrap()).collect();
    assert_eq!(printed, plants.iter().map(|p| p.0.as_str()).collect::<Vec<_>>());
    // Each plant waits to be synced, exactly once.
    let outbox: i64 =
        Connection::open(&first).unwrap().query_row("SELECT count(*) FROM outbox", [], |row| row.get(0)).unwrap();
    assert_eq!(outbox as usize, plants.len());

    let truth: Value = serde_json::from_slice(&std::fs::read(fixture().join("truth.json")).unwrap()).unwrap();
    let grown = truth["plants"].as_array().unwrap();
    assert_eq!(plants.len(), grown.len(), "every plant of the row, once");
    let mean = |of: &dyn Fn(&Value) -> f64, all: &[Value]| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let found = mean(&|p| p["traits"]["height"]["value"].as_f64().unwrap(), replayed["plants"].as_array().unwrap());
    let true_height = mean(&|p| p["height"].as_f64().unwrap(), grown);
    assert!((found / true_height - 1.0).abs() < 0.25, "mean height {found} m, true {true_height} m");
    for plant in replayed["plants"].as_array().unwrap() {
        assert_eq!(plant["scale_source"], "ground_plane");
        let id = plant["id"].as_str().unwrap();
        let (code, shown) = answer(&["plants", "show", id, "--db", first.to_str().unwrap()]);
        assert_eq!((code, &shown["plants"][0]["traits"]), (Some(0), &plant["traits"]));
    }
}

/// The bundled session as another camera would have seen it from the same places.
fn seen_by(camera: &Calibration, folder: &Path) -> Manifest {
    let mut source = Replay::open(&fixture(), Pace::Max).unwrap();
    let mut manifest = source.manifest().clone();
    let pinhole = manifest.cameras[0].intrinsics;
    manifest.cameras[0].intrinsics = *camera.intrinsics();
    manifest.cameras[0].distortion = camera.distortion().copied();
    let mut recorder = Recorder::create(folder, manifest.clone()).unwrap();
    while let Some(frame) = source.next().unwrap() {
        let before = decode(&frame).unwrap();
        let seen = Rgb::from_fn(pinhole.width, pinhole.height, |x, y| {
            let ray = camera.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), 1.0).unwrap();
            let at = pinhole.project(ray).unwrap() - 0.5;
            interpolate_bilinear(&before, at.x as f32, at.y as f32).unwrap_or(image::Rgb([0; 3]))
        });
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(&seen).unwrap();
        recorder.write(&Frame { bytes: bytes.into(), ..frame }).unwrap();
    }
    recorder.finish().unwrap();
    manifest
}

/// A lens that bends pictures outwards, against the pinhole that sees the same part of the world.
#[test]
fn what_a_lens_bends_is_measured_as_if_it_did_not() {
    let folder = tempfile::tempdir().unwrap();
    let pinhole = Replay::open(&fixture(), Pace::Max).unwrap().manifest().cameras[0].intrinsics;
    let lens = Distortion::PlumbBob { coefficients: [0.5, 0.1, 2e-3, -2e-3, 0.0] };
    let bent = Calibration::new(pinhole, Some(lens)).unwrap();
    let straight = Calibration::new(bent.pinhole(), None).unwrap();
    let sessions = ["bent", "straight"].map(|name| folder.path().join(name));
    let manifest = seen_by(&bent, &sessions[0]);
    seen_by(&straight, &sessions[1]);
    let heights = |session: &Path, db: &str| {
        let (code, replayed) = replay(session, &folder.path().join(db));
        assert_eq!(code, Some(0), "{replayed}");
        let plants = replayed["plants"].as_array().unwrap().clone();
        plants.iter().map(|plant| plant["traits"]["height"]["value"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    let bent = heights(&sessions[0], "bent.sqlite");
    let straight = heights(&sessions[1], "straight.sqlite");
    assert_eq!(straight.len(), bent.len());
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    // Resampled once more, pictures are not quite the same to the network.
    assert!((mean(&bent) / mean(&straight) - 1.0).abs() < 0.1, "{bent:?}, without the lens {straight:?}");
    // The calibration is kept beside the plants.
    let kept: String = Connection::open(folder.path().join("bent.sqlite"))
        .unwrap()
        .query_row("SELECT calibration FROM cameras", [], |row| row.get(0))
        .unwrap();
    assert_eq!(serde_json::from_str::<SessionCamera>(&kept).unwrap(), manifest.cameras[0]);
}

#[test]
fn a_damaged_frame_costs_that_frame_alone() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("row");
    copy(&fixture(), &session);
    let frames: Vec<PathBuf> =
        std::fs::read_dir(session.join("frames")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let damaged = frames.iter().min().unwrap();
    let bytes = std::fs::read(damaged).unwrap();
    std::fs::write(damaged, &bytes[..bytes.len() / 2]).unwrap();
    let db = folder.path().join("db.sqlite");
    let (code, replayed) = replay(&session, &db);
    assert_eq!(code, Some(3), "partial: {replayed}");
    let warnings = replayed["warnings"].to_string();
    assert!(warnings.contains('1'), "the damaged frame is told of: {warnings}");
    assert!(!stored(&db).is_empty());
}

#[test]
fn what_is_no_session_is_refused_and_leaves_no_database() {
    let folder = tempfile::tempdir().unwrap();
    let db = folder.path().join("db.sqlite");
    for (name, toml) in [("none", None), ("empty", Some("")), ("newer", Some("schema_version = 99"))] {
        let session = folder.path().join(name);
        std::fs::create_dir(&session).unwrap();
        if let Some(toml) = toml {
            std::fs::write(session.join("session.toml"), toml).unwrap();
        }
        let (code, refused) = replay(&session, &db);
        assert!(matches!(code, Some(1 | 2 | 78)), "{name}: {code:?} {refused}");
        assert!(refused["error"]["message"].as_str().unwrap().contains("session.toml"), "{name}: {refused}");
        assert!(!db.exists(), "{name}: nothing is created for a session that is none");
    }
    let output = demeter().args(["replay"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}
