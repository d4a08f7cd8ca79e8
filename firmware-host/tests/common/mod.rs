//! A store in a temporary folder with a session, a species and a network, and plants to put into it.
#![allow(dead_code)]

pub(crate) mod brapi;
pub(crate) mod daemon;
pub(crate) mod depot;
pub(crate) mod sync;

use std::path::{Path, PathBuf};

use demeter::report::{Kind, OrganReport, PlantReport};
use demeter::store::{NewPlant, NewSession, Store};
use demeter::synthetic::Synthetic;
use demeter_capture::Manifest;
use demeter_frame::{Intrinsics, Pose};
use demeter_recon::model::leaf::Blade;
use demeter_recon::model::{Form, Joint, Organ, Plant, Species};
use demeter_recon::organs::ScaleSource;
use demeter_recon::record::encode_compact;
use demeter_recon::traits::{Quantity, Unit};
use demeter_recon::world::Row;
use glam::{DQuat, DVec3};

pub(crate) struct Bench {
    pub(crate) folder: tempfile::TempDir,
    pub(crate) path: PathBuf,
    pub(crate) store: Store,
    pub(crate) species: Species,
}

pub(crate) const MODEL: &str = "ab54d286dfd1a2d5e0c0c7e4b9c1f3c2aabbccddeeff00112233445566778899";

pub(crate) fn bench() -> Bench {
    bench_in(tempfile::tempdir().unwrap())
}

/// The store in a folder of the caller's, opened again or made.
pub(crate) fn bench_in(folder: tempfile::TempDir) -> Bench {
    let path = folder.path().join("demeter.sqlite");
    let store = Store::open(&path).unwrap();
    let species = demeter_recon::species::shipped("soybean").unwrap().unwrap();
    store.save_species(&species).unwrap();
    store.save_model(MODEL, "organ2d").unwrap();
    let cameras = vec![("nadir".to_owned(), serde_json::json!({"fx": 500.0}))];
    store.save_session(&NewSession { id: "row".into(), rig: "rig-1".into(), cameras }).unwrap();
    Bench { folder, path, store, species }
}

/// A rig before so many plants of a species, four frames each, and its session.
pub(crate) fn row(species: &Species, plants: usize, id: &str) -> (Synthetic, Manifest) {
    let plan = Row { plants, spacing: 0.35, age: 0.25, frames: 4 * plants };
    let camera = Intrinsics::from_hfov(640, 480, 0.733);
    let source = Synthetic::new(species, &plan, camera, 0, id.into()).unwrap();
    let manifest = source.manifest("soybean", &plan);
    (source, manifest)
}

/// Every file below a folder.
pub(crate) fn walk(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}

/// The store with so many plants in it.
pub(crate) fn stored(plants: u32) -> Bench {
    let bench = bench();
    for n in 1..=plants {
        bench.store.save_plant(&bench.plant(n)).unwrap();
    }
    bench
}

impl Bench {
    /// Plant number `n` with two organs in its report; its height is `n` centimetres.
    pub(crate) fn plant(&self, n: u32) -> NewPlant {
        let quantity = |value, unit| Quantity { value, unit, sigma: Some(0.01) };
        let organ = |id, kind, parent, leaf| OrganReport {
            id,
            kind,
            parent,
            leaf,
            points: Some(100),
            residual: Some(0.002),
            visible_fraction: Some(0.5),
            traits: [("stem_length".into(), quantity(0.1, Unit::Metre))].into(),
        };
        let record = encode_compact(&model(n), &self.species, ScaleSource::GroundPlane).unwrap();
        NewPlant {
            report: PlantReport {
                id: Some(format!("row-{n:04}")),
                species: "soybean".into(),
                species_hash: Some(self.species.hash().to_owned()),
                organs: vec![organ(0, Kind::MainStem, None, None), organ(1, Kind::Leaf, Some(0), Some(0))],
                traits: [
                    ("height".into(), quantity(f64::from(n) / 100.0, Unit::Metre)),
                    ("leaf_count".into(), quantity(1.0, Unit::One)),
                    ("blade_count".into(), quantity(1.0, Unit::One)),
                    ("leaf_area".into(), quantity(0.003, Unit::SquareMetre)),
                ]
                .into(),
                cd: Some(0.02),
                bytes: record.len(),
                scale_source: ScaleSource::GroundPlane,
                record: None,
                camera: None,
                warnings: vec!["one blade was hidden".into()],
                ms: Some(12.0),
            },
            record,
            session: "row".into(),
            time: "2026-06-01T10:00:00Z".into(),
            time_trusted: true,
            position: Some(DVec3::new(0.25 * f64::from(n), 0.0, 0.0)),
            geographic: None,
            models: vec![MODEL.into()],
            provenance: serde_json::json!({"program": "0.1.0"}),
            observations: vec![("nadir".into(), u64::from(n)), ("nadir".into(), u64::from(n) + 1)],
            thumbnail: Some(vec![7; 10]),
        }
    }

    /// A number that a query gives, on a connection of its own.
    pub(crate) fn number(&self, sql: &str) -> i64 {
        rusqlite::Connection::open(&self.path).unwrap().query_row(sql, [], |row| row.get(0)).unwrap()
    }

    /// Every plant is whole: nothing of it is missing and it is still to be sent.
    pub(crate) fn assert_whole(&self) {
        let store = rusqlite::Connection::open(&self.path).unwrap();
        let sound: String = store.query_row("PRAGMA integrity_check", [], |row| row.get(0)).unwrap();
        assert_eq!(sound, "ok");
        assert_eq!(self.number("SELECT count(*) FROM pragma_foreign_key_check"), 0);
        for table in ["outbox", "organs", "plant_models", "observations"] {
            let half = format!("SELECT count(*) FROM plants WHERE seq NOT IN (SELECT plant FROM {table})");
            assert_eq!(self.number(&half), 0, "plants without {table}");
        }
    }

    /// Rows of each table that a plant writes to.
    pub(crate) fn rows(&self) -> [i64; 5] {
        ["plants", "organs", "plant_models", "observations", "outbox"]
            .map(|table| self.number(&format!("SELECT count(*) FROM {table}")))
    }
}

/// A stem of `n` centimetres with three leaves on petioles.
fn model(n: u32) -> Plant {
    let stem = |parent, d, rotation, scale| Organ {
        parent,
        joint: Joint { d, rotation, scale },
        form: Form::Stem { gamma: vec![], radius: 0.01 },
    };
    let mut organs = vec![stem(None, 0.0, DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2), f64::from(n) / 100.0)];
    for leaf in 0..3 {
        let turn = DQuat::from_rotation_y(2.4 * f64::from(leaf));
        organs.push(stem(Some(0), 0.4 + 0.3 * f64::from(leaf), turn * DQuat::from_rotation_x(0.9), 0.5));
        organs.push(Organ {
            parent: Some(organs.len() - 1),
            joint: Joint { d: 1.0, rotation: DQuat::from_rotation_x(0.5), scale: 0.9 },
            form: Form::Leaf { blade: Blade { beta: vec![], gamma: vec![], width: 1.0 }, leaf: leaf as u16 },
        });
    }
    Plant { world_from_plant: Pose::IDENTITY, organs }
}
