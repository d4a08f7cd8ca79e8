//! The store keeps its promises: settings, migrations, one transaction a plant, refusals that change nothing.
#![allow(clippy::unwrap_used)]

mod common;

use std::os::unix::fs::PermissionsExt;

use common::{MODEL, bench};
use demeter::error::{CommandError, Exit};
use demeter::store::{APPLICATION_ID, NewPlant, NewSession, Reader, Reserve, Saved, Store, StoreError};

#[test]
fn every_connection_has_the_pragmas_and_sqlite_is_new_enough() {
    let bench = bench();
    let expected = [
        ("synchronous", "2"),
        ("foreign_keys", "1"),
        ("trusted_schema", "0"),
        ("cell_size_check", "1"),
        ("mmap_size", "0"),
        ("wal_autocheckpoint", "512"),
        ("journal_size_limit", "2097152"),
        ("journal_mode", "wal"),
    ]
    .map(|(pragma, value)| (pragma, value.to_owned()));
    assert_eq!(bench.store.pragmas().unwrap(), expected);
    assert_eq!(bench.store.reader().unwrap().pragmas().unwrap(), expected);
    assert_eq!(Reserve::BYTES, 2 * 2_097_152, "twice what the log is cut back to");
    assert_eq!(bench.number("PRAGMA application_id"), i64::from(APPLICATION_ID));
    // Negative control: a connection that sets nothing has other values, so the settings above are ours.
    assert_eq!(bench.number("PRAGMA cell_size_check"), 0);
    assert!(rusqlite::version_number() >= 3_051_003, "{}", rusqlite::version());
    let mode = std::fs::metadata(&bench.path).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o640, "for the group of operators to read");
}

#[test]
fn every_table_is_strict_and_reopening_changes_nothing() {
    let bench = bench();
    bench.store.save_plant(&bench.plant(1)).unwrap();
    let again = Store::open(&bench.path).unwrap();
    assert_eq!(again.reader().unwrap().summary().unwrap().plants, 1);
    assert_eq!(bench.number("PRAGMA user_version"), 3);
    let ours = "SELECT count(*) FROM pragma_table_list WHERE schema = 'main' AND name NOT LIKE 'sqlite_%'";
    assert_eq!((bench.number(ours), bench.number(&format!("{ours} AND NOT strict"))), (15, 0));
}

#[test]
fn a_plant_is_saved_once_with_everything_that_belongs_to_it() {
    let bench = bench();
    let plant = bench.plant(1);
    assert_eq!(bench.store.save_plant(&plant).unwrap(), Saved::New);
    let rows = [1, 2, 1, 2, 1];
    assert_eq!(bench.rows(), rows);
    for _ in 0..100 {
        assert_eq!(bench.store.save_plant(&plant).unwrap(), Saved::Same);
    }
    assert_eq!(bench.rows(), rows);

    let reader = bench.store.reader().unwrap();
    let mut expected = plant.report.clone();
    expected.ms = None;
    assert_eq!(reader.plant("row-0001").unwrap().unwrap(), expected);
    assert_eq!(reader.record("row-0001").unwrap().unwrap().record, plant.record);
    let file = reader.record("row-0001").unwrap().unwrap().species;
    assert_eq!(blake3::hash(&file).to_hex().as_str(), bench.species.hash());
    assert_eq!(reader.thumbnail("row-0001").unwrap(), plant.thumbnail);
    assert_eq!(reader.plant("row-0002").unwrap(), None);
}

#[test]
fn another_body_under_the_same_id_is_refused_whatever_differs() {
    let bench = bench();
    let plant = bench.plant(1);
    bench.store.save_plant(&plant).unwrap();
    let changes: [fn(&mut NewPlant); 7] = [
        |p| p.record[0] ^= 1,
        |p| p.report.traits.get_mut("height").unwrap().value += 1e-12,
        |p| p.report.organs[1].leaf = Some(1),
        |p| p.time = "2026-06-01T10:00:01Z".into(),
        |p| p.observations[0].1 = 77,
        |p| p.provenance = serde_json::json!({"program": "0.1.1"}),
        |p| p.thumbnail = None,
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let mut other = plant.clone();
        change(&mut other);
        let error = bench.store.save_plant(&other).unwrap_err();
        assert!(matches!(error, StoreError::Conflict { .. }), "change {i}: {error}");
    }
    // Negative control: the time a plant took is no part of it.
    let mut slower = plant.clone();
    slower.report.ms = Some(99.0);
    assert_eq!(bench.store.save_plant(&slower).unwrap(), Saved::Same);
    assert_eq!(bench.rows(), [1, 2, 1, 2, 1]);
}

#[test]
fn an_error_in_the_middle_writes_nothing() {
    let bench = bench();
    let plant = bench.plant(1);
    let spoil: [fn(&mut NewPlant); 4] = [
        |p| p.models = vec![MODEL.replace('a', "0")],
        |p| p.observations[1].0 = "unknown camera".into(),
        |p| p.report.organs[1].parent = Some(9),
        |p| p.report.species_hash = Some("0".repeat(64)),
    ];
    for (i, spoil) in spoil.into_iter().enumerate() {
        let mut bad = plant.clone();
        spoil(&mut bad);
        let error = bench.store.save_plant(&bad).unwrap_err();
        assert!(matches!(error, StoreError::Sqlite { .. }), "case {i}: {error}");
        assert_eq!(bench.rows(), [0; 5], "case {i}");
    }
    // The last statement of the transaction fails.
    let sql = "CREATE TRIGGER full BEFORE INSERT ON outbox BEGIN SELECT RAISE(ABORT, 'disk full'); END";
    let other = rusqlite::Connection::open(&bench.path).unwrap();
    other.execute_batch(sql).unwrap();
    let error = bench.store.save_plant(&plant).unwrap_err();
    assert!(error.to_string().contains("outbox"), "{error}");
    assert_eq!(bench.rows(), [0; 5]);
    other.execute_batch("DROP TRIGGER full").unwrap();
    assert_eq!(bench.store.save_plant(&plant).unwrap(), Saved::New, "the store works on afterwards");
}

#[test]
fn values_that_must_not_be_stored_are_named() {
    let bench = bench();
    type Spoil = fn(&mut NewPlant);
    let changes: [(&str, Spoil); 7] = [
        ("id", |p| p.report.id = None),
        ("id", |p| p.report.id = Some("../etc/passwd".into())),
        ("bytes", |p| p.report.bytes += 1),
        ("height", |p| p.report.traits.get_mut("height").unwrap().value = f64::NAN),
        ("stem_length", |p| p.report.organs[0].traits.get_mut("stem_length").unwrap().sigma = Some(f64::INFINITY)),
        ("cd", |p| p.report.cd = Some(f64::NAN)),
        ("position", |p| p.position = Some(glam::DVec3::NAN)),
    ];
    for (expected, change) in changes {
        let mut bad = bench.plant(1);
        change(&mut bad);
        match bench.store.save_plant(&bad).unwrap_err() {
            StoreError::Value { key, .. } => assert_eq!(key, expected),
            other => panic!("{expected}: {other}"),
        }
    }
    assert_eq!(bench.rows(), [0; 5]);
}

#[test]
fn sessions_keep_their_rig_and_calibration() {
    let bench = bench();
    let same = NewSession {
        id: "row".into(),
        rig: "rig-1".into(),
        cameras: vec![("nadir".into(), serde_json::json!({"fx": 500.0}))],
    };
    bench.store.save_session(&same).unwrap();
    let mut other = same.clone();
    other.cameras[0].1 = serde_json::json!({"fx": 501.0});
    assert!(matches!(bench.store.save_session(&other), Err(StoreError::Conflict { what: "camera", .. })));
    let other = NewSession { rig: "rig-2".into(), ..same };
    assert!(matches!(bench.store.save_session(&other), Err(StoreError::Conflict { what: "session", .. })));
}

#[test]
fn pages_follow_the_cursor_without_gap_or_double() {
    let bench = bench();
    for n in 1..=7 {
        bench.store.save_plant(&bench.plant(n)).unwrap();
    }
    let reader = bench.store.reader().unwrap();
    let (mut ids, mut cursor) = (vec![], None);
    loop {
        let page = reader.page(cursor, 3).unwrap();
        ids.extend(page.plants.into_iter().map(|plant| plant.id));
        cursor = page.next;
        if cursor.is_none() {
            break;
        }
    }
    let expected: Vec<String> = (1..=7).rev().map(|n| format!("row-{n:04}")).collect();
    assert_eq!(ids, expected);
    assert_eq!(reader.all().unwrap().len(), 7);
    assert_eq!(reader.page(Some(i64::MIN), 3).unwrap().plants, []);
    assert_eq!(reader.page(Some(i64::MAX), u32::MAX).unwrap().plants.len(), 7);
    let summary = reader.summary().unwrap();
    assert_eq!((summary.plants, summary.unsent, summary.sessions[0].plants), (7, 7, 7));
    assert_eq!(summary.last_plant.as_deref(), Some("2026-06-01T10:00:00Z"));
}

#[test]
fn a_newer_schema_is_refused_and_the_file_is_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("newer.sqlite");
    drop(Store::open(&path).unwrap());
    rusqlite::Connection::open(&path).unwrap().pragma_update(None, "user_version", 99).unwrap();
    let before = std::fs::read(&path).unwrap();
    for error in [Store::open(&path).unwrap_err(), Reader::open(&path).unwrap_err()] {
        assert!(matches!(error, StoreError::NewerSchema { found: 99, .. }), "{error}");
        assert_eq!(CommandError::from(error).exit, Exit::NewerSchema);
    }
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn files_that_are_no_store_are_refused_and_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("notes.txt");
    std::fs::write(&text, "not a database, just some notes that somebody keeps\n".repeat(100)).unwrap();
    let foreign = folder.path().join("foreign.sqlite");
    rusqlite::Connection::open(&foreign).unwrap().execute_batch("CREATE TABLE theirs (x)").unwrap();
    for path in [text, foreign] {
        let before = std::fs::read(&path).unwrap();
        for error in [Store::open(&path).unwrap_err(), Reader::open(&path).unwrap_err()] {
            assert!(matches!(error, StoreError::NotAStore { .. }), "{error}");
        }
        assert_eq!(std::fs::read(&path).unwrap(), before, "{}", path.display());
    }
    let missing = folder.path().join("missing.sqlite");
    assert!(matches!(Reader::open(&missing), Err(StoreError::Missing { .. })));
    assert!(!missing.exists(), "reading makes no file");
    assert!(Store::open(folder.path()).is_err(), "a folder is no store");
    assert!(Store::open(&folder.path().join("no/such/folder.sqlite")).is_err());

    let empty = folder.path().join("empty.sqlite");
    std::fs::write(&empty, "").unwrap();
    Store::open(&empty).unwrap();
}

#[test]
fn events_are_kept_apart_from_plants() {
    let bench = bench();
    let detail = serde_json::json!({"ms": 12.5});
    bench.store.save_event(jiff::Timestamp::UNIX_EPOCH, "plant_timing", &detail).unwrap();
    assert_eq!(bench.number("SELECT count(*) FROM events WHERE time = '1970-01-01T00:00:00Z'"), 1);
    assert_eq!(bench.rows(), [0; 5]);
}
