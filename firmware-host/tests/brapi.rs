//! Plants at a BrAPI server: each is one unit with its observations, whatever the server does in between.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeSet;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use common::brapi::{Database, STUDY};
use common::depot::{Depot, Fault};
use common::sync::{Clock, SECRET, pass};
use common::{Bench, bench};
use demeter::config::{BrapiConfig, SyncConfig};
use demeter::sync::Brapi;
use serde_json::{Value, json};

/// A server of units, and one of files.
struct Servers {
    database: Database,
    brapi: Depot,
    files: Depot,
}

impl Servers {
    fn start() -> Self {
        let database = Database::default();
        let ours = database.clone();
        let brapi = Depot::with(move |request, body, deaf| ours.answer(request, body, deaf));
        Self { database, brapi, files: Depot::start(None, |_| Fault::None) }
    }

    fn config(&self, bench: &Bench) -> SyncConfig {
        let brapi = BrapiConfig {
            url: format!("http://{}/brapi/v2/", self.brapi.address),
            study: STUDY.into(),
            germplasm: Some("variety-3".into()),
            credential: "demeter-brapi".into(),
            secret_file: Some(bench.secret_file()),
            ca_file: None,
        };
        SyncConfig { brapi: Some(brapi), ..bench.config(&format!("http://{}/base", self.files.address)) }
    }

    /// Every plant of the box is one unit with one observation for each of its traits that an ontology has.
    fn judge(&self, bench: &Bench) -> Result<(), String> {
        let (units, observations) = (self.database.units.lock().unwrap(), self.database.observations.lock().unwrap());
        let names: BTreeSet<_> = units.values().map(|unit| unit["observationUnitName"].to_string()).collect();
        let plants = bench.number("SELECT count(*) FROM plants") as usize;
        if (names.len(), units.len()) != (plants, plants) {
            return Err(format!("{plants} plants are {} units of {} names", units.len(), names.len()));
        }
        for (id, unit) in &*units {
            let of_unit = observations.values().filter(|found| found["observationUnitDbId"] == **id);
            let mut found: Vec<_> = of_unit
                .map(|found| (found["observationVariableDbId"].as_str().unwrap(), found["value"].as_str().unwrap()))
                .collect();
            found.sort_unstable();
            let number: f64 = unit["observationUnitName"].as_str().unwrap()[4..].parse().unwrap();
            let height = (number / 100.0).to_string();
            let expected = [("CO_336:0000258", height.as_str()), ("CO_336:0000315", "1"), ("TO:0000827", "0.003")];
            if found != expected {
                return Err(format!("{id}: {found:?}"));
            }
        }
        Ok(())
    }
}

#[test]
fn a_plant_is_a_unit_with_its_place_and_its_traits_are_observations() {
    let (bench, servers) = (bench(), Servers::start());
    bench.fill(1..=4);
    let (config, clock) = (servers.config(&bench), Clock::new());
    let done = pass(&bench.syncer(&config, &clock));
    assert_eq!((done.sent, done.left, done.observed, done.unobserved, done.failure), (4, 0, 4, 0, None));
    servers.judge(&bench).unwrap();
    let units = servers.database.units.lock().unwrap();
    let unit = |name: &str| units.values().find(|unit| unit["observationUnitName"] == name).unwrap().clone();
    let second = unit("row-0002");
    assert_eq!(
        second["externalReferences"],
        json!([{"referenceId": "rig 2/a/row-0002", "referenceSource": "demeter"}])
    );
    assert_eq!(
        (&second["observationUnitPUI"], &second["germplasmDbId"]),
        (&"rig 2/a/row-0002".into(), &"variety-3".into())
    );
    let position = &second["observationUnitPosition"];
    assert_eq!(position["observationLevel"], json!({"levelName": "plant", "levelCode": "row-0002"}));
    assert_eq!(position["geoCoordinates"]["geometry"], json!({"type": "Point", "coordinates": [5.5, 52.00002]}));
    // The fourth plant is the second of its session.
    let fourth = &unit("row-0004")["observationUnitPosition"];
    assert_eq!(
        (&fourth["positionCoordinateX"], &fourth["positionCoordinateXType"]),
        (&"2".into(), &"PLANTED_INDIVIDUAL".into())
    );
    assert_eq!(unit("row-0001")["observationUnitPosition"].get("geoCoordinates"), None);

    let observations = servers.database.observations.lock().unwrap();
    let height = observations.values().find(|found| found["value"] == "0.02").unwrap();
    assert_eq!(height["observationTimeStamp"], "2026-06-02T10:00:00Z");
    assert_eq!((&height["collector"], &height["season"]["year"]), (&"demeter rig 2/a".into(), &2026.into()));
    let more = json!({"trait": "height", "unit": "m", "sigma": 0.01, "timeTrusted": true});
    assert_eq!(height["additionalInfo"], more);
    drop((units, observations));

    // What is there is known: nothing more is sent.
    let requests = servers.brapi.requests().len();
    assert_eq!(pass(&bench.syncer(&config, &clock)).unobserved, 0);
    assert_eq!(servers.brapi.requests().len(), requests);
    let outbox = bench.store.reader().unwrap().units(&config.brapi.unwrap().name(), 10).unwrap();
    assert_eq!((outbox.waiting, outbox.sent), (0, 4));
}

#[test]
fn the_same_plant_again_is_put_and_not_posted() {
    let (bench, servers) = (bench(), Servers::start());
    bench.fill(1..=2);
    let config = servers.config(&bench);
    let brapi = Brapi::open(config.brapi.as_ref().unwrap()).unwrap();
    let plants = bench.store.reader().unwrap().whole(&[1, 2]).unwrap();
    let runtime = common::sync::runtime();
    for _ in 0..5 {
        for plant in &plants {
            runtime.block_on(brapi.send(plant, 1)).unwrap();
        }
    }
    servers.judge(&bench).unwrap();
    let posts = servers.brapi.requests().into_iter().filter(|request| request.method == "POST").count();
    assert_eq!(posts, 4, "a unit and its observations, twice");
    // An observation that somebody changed there is set right, by the same id.
    let before = servers.database.observations.lock().unwrap().clone();
    let (id, mut changed) = before.first_key_value().map(|(id, found)| (id.clone(), found.clone())).unwrap();
    changed["value"] = "99".into();
    servers.database.observations.lock().unwrap().insert(id, changed);
    runtime.block_on(brapi.send(&plants[0], 1)).unwrap();
    assert_eq!(*servers.database.observations.lock().unwrap(), before);
    // Negative control of the judge.
    servers.database.units.lock().unwrap().insert("again".into(), Value::Null);
    assert!(servers.judge(&bench).is_err());
}

#[test]
fn brapi_chaos() {
    let seed = std::env::var("DEMETER_SEED").map_or_else(|_| fastrand::u64(..), |seed| seed.parse().unwrap());
    eprintln!("seed {seed}: DEMETER_SEED={seed} repeats it");
    let (bench, servers) = (bench(), Servers::start());
    bench.fill(1..=60);
    let elsewhere = Depot::start(None, |_| Fault::None);
    let there = format!("http://{}/stolen", elsewhere.address);
    let lots = Mutex::new(fastrand::Rng::with_seed(seed));
    servers.brapi.plan(move |_| match lots.lock().unwrap().u32(0..40) {
        0 => Fault::Status(500),
        1 => Fault::Status(429),
        2 => Fault::Redirect(there.clone()),
        3 => Fault::Drop,
        4 => Fault::Cut,
        5 => Fault::CommitThenDrop,
        6 => Fault::WrongAcknowledgement,
        7 => Fault::Partial,
        8 => Fault::Garbage,
        9 => Fault::Status(400),
        _ => Fault::None,
    });
    let (config, clock) = (servers.config(&bench), Clock::new());
    let mut passes = 0;
    loop {
        let done = pass(&bench.syncer(&config, &clock));
        // The files went their own way.
        assert_eq!(done.left, 0);
        if done.unobserved == 0 {
            break;
        }
        passes += 1;
        assert!(passes < 2000, "it does not converge: {:?}", done.failure);
    }
    eprintln!("{passes} passes, {} requests", servers.brapi.requests().len());
    servers.judge(&bench).unwrap();
    assert_eq!(elsewhere.connections(), 0, "redirects are not followed");
}

#[test]
fn what_waits_says_why_and_a_plant_that_is_refused_does_not_hold_up_the_others() {
    let (bench, servers) = (bench(), Servers::start());
    bench.fill(1..=4);
    let (config, clock) = (servers.config(&bench), Clock::new());
    servers.brapi.plan(|_| Fault::Status(503));
    let done = pass(&bench.syncer(&config, &clock));
    assert_eq!((done.left, done.observed, done.unobserved), (0, 0, 4));
    assert_eq!(servers.brapi.requests().len(), 1, "a server that fails is not asked for each plant");
    let units = || bench.store.reader().unwrap().units(&config.brapi.as_ref().unwrap().name(), 10).unwrap();
    assert!(units().plants[0].reason.as_ref().unwrap().contains("503"));
    assert_eq!((units().plants[0].attempts, units().plants[1].attempts), (1, 0));

    // The next unit is refused.
    let refused = AtomicBool::new(false);
    servers.brapi.plan(move |request| {
        let refuse = request.method == "POST" && !refused.swap(true, Ordering::SeqCst);
        if refuse { Fault::Status(400) } else { Fault::None }
    });
    let done = pass(&bench.syncer(&config, &clock));
    assert_eq!((done.observed, done.unobserved), (3, 1));
    assert!(units().plants[0].reason.as_ref().unwrap().contains("400"));
    assert_eq!(pass(&bench.syncer(&config, &clock)).unobserved, 0);
    servers.judge(&bench).unwrap();
}

#[test]
fn the_token_is_sent_and_nowhere_said() {
    let (bench, servers) = (bench(), Servers::start());
    bench.fill(1..=2);
    let (config, clock) = (servers.config(&bench), Clock::new());
    // The server quotes our own headers back at us.
    servers.brapi.plan(|_| Fault::Status(401));
    let done = pass(&bench.syncer(&config, &clock));
    let told = format!("{done:?}{config:?}{:?}", Brapi::open(config.brapi.as_ref().unwrap()).unwrap());
    assert!(done.failure.unwrap().contains("401") && !told.contains(SECRET));
    assert!(servers.brapi.requests()[0].headers.contains(&format!("Bearer {SECRET}")));
    let store = std::fs::read(&bench.path).unwrap();
    assert!(!store.windows(SECRET.len()).any(|window| window == SECRET.as_bytes()));

    for url in ["http://breeding.example/brapi/v2", "https://user:hunter2@x/brapi", "ftp://x", "https://x/?a=b"] {
        let config = BrapiConfig { url: url.into(), ..config.brapi.clone().unwrap() };
        let error = Brapi::open(&config).unwrap_err().to_string();
        assert!(error.contains("sync.brapi.url") && !error.contains("hunter2"), "{error}");
    }
}

#[test]
fn the_program_sends_units_and_says_nothing_of_the_token() {
    let (bench, servers, disk) = (bench(), Servers::start(), tempfile::tempdir().unwrap());
    bench.fill(1..=2);
    let config = bench.folder.path().join("demeter.toml");
    let text = format!(
        "[store]\npath = '{}'\n[api]\nlisten = '127.0.0.1:1'\n[sync]\nurl = 'file://{}'\ntrust_clock = true\n\
         [sync.brapi]\nurl = 'http://{}/brapi/v2'\nstudy = '{STUDY}'\nsecret_file = '{}'\n",
        bench.path.display(),
        disk.path().display(),
        servers.brapi.address,
        bench.secret_file().display()
    );
    std::fs::write(&config, text).unwrap();
    let program = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_demeter"));
        let output = command.arg("sync").args(arguments).arg("--config").arg(&config).env("RUST_LOG", "trace").output();
        let output = output.unwrap();
        let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert!(output.status.success() && !said.contains(SECRET), "{said}");
        said
    };
    assert!(program(&["--status"]).contains("study field-7: 2 plants wait, 0 have left"));
    let said = program(&["--now"]);
    assert!(said.contains("2 plants sent, 0 wait; BrAPI: 2 sent, 0 wait"), "{said}");
    assert!(program(&["--status"]).contains("study field-7: 0 plants wait, 2 have left"));
    servers.judge(&bench).unwrap();
    assert!(servers.brapi.requests().iter().all(|request| request.headers.contains(SECRET)));
}
