//! A box that syncs to a depot under a clock of the test's own.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use arrow_array::cast::AsArray;
use arrow_array::{Array, RecordBatch};
use demeter::config::SyncConfig;
use demeter::sync::{Brapi, Destination, Pass, SyncClock, Syncer};
use jiff::Timestamp;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use super::Bench;

/// What no file, log or answer may show.
pub(crate) const SECRET: &str = "c4nary-s3cret-0123456789";

/// A clock that jumps over every wait.
pub(crate) struct Clock {
    now: Mutex<Timestamp>,
    pub(crate) trusted: AtomicBool,
    pub(crate) waits: Mutex<Vec<Duration>>,
}

impl Clock {
    pub(crate) fn new() -> Self {
        let now = Mutex::new("2026-06-01T22:00:00Z".parse().unwrap());
        Self { now, trusted: AtomicBool::new(true), waits: Mutex::default() }
    }
}

impl SyncClock for Clock {
    fn now(&self) -> Timestamp {
        *self.now.lock().unwrap()
    }

    fn trusted(&self) -> bool {
        self.trusted.load(Ordering::SeqCst)
    }

    async fn sleep(&self, duration: Duration) {
        *self.now.lock().unwrap() += duration;
        self.waits.lock().unwrap().push(duration);
        tokio::task::yield_now().await;
    }
}

impl Bench {
    pub(crate) fn secret_file(&self) -> PathBuf {
        use std::os::unix::fs::OpenOptionsExt;
        let path = self.folder.path().join("secret");
        let mut options = std::fs::OpenOptions::new();
        let mut file = options.write(true).create(true).truncate(true).mode(0o600).open(&path).unwrap();
        std::io::Write::write_all(&mut file, SECRET.as_bytes()).unwrap();
        path
    }

    /// Plants `from` to `to` with pictures of their own, three rigs and two days.
    pub(crate) fn fill(&self, numbers: std::ops::RangeInclusive<u32>) {
        for rig in 1..3 {
            let cameras = vec![("nadir".to_owned(), serde_json::json!({"fx": 500.0}))];
            let (id, rig) = (format!("row-{rig}"), format!("rig {rig}/a"));
            self.store.save_session(&demeter::store::NewSession { id, rig, cameras }).unwrap();
        }
        for n in numbers {
            let mut plant = self.plant(n);
            plant.thumbnail = Some(format!("picture {n}").into_bytes());
            if n % 3 > 0 {
                plant.session = format!("row-{}", n % 3);
            }
            if n % 2 == 0 {
                plant.time = "2026-06-02T10:00:00Z".into();
                plant.geographic = Some([52.0 + f64::from(n) * 1e-5, 5.5]);
            }
            self.store.save_plant(&plant).unwrap();
        }
    }

    pub(crate) fn config(&self, url: &str) -> SyncConfig {
        SyncConfig { url: Some(url.into()), secret_file: Some(self.secret_file()), ..SyncConfig::default() }
    }

    pub(crate) fn syncer<'a>(&'a self, config: &SyncConfig, clock: &'a Clock) -> Syncer<'a, &'a Clock> {
        let destination = Destination::open(config).unwrap().unwrap();
        Syncer {
            store: &self.store,
            reader: self.store.reader().unwrap(),
            destination,
            brapi: config.brapi.as_ref().map(|config| Brapi::open(config).unwrap()),
            clock,
            trusting: false,
            plants_a_table: 16,
        }
    }
}

/// One pass on a runtime of its own.
pub(crate) fn pass(syncer: &Syncer<'_, &Clock>) -> Pass {
    runtime().block_on(syncer.pass()).unwrap()
}

pub(crate) fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap()
}

pub(crate) fn rows(file: &[u8]) -> Vec<RecordBatch> {
    let reader = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::copy_from_slice(file)).unwrap();
    reader.build().unwrap().map(Result::unwrap).collect()
}

pub(crate) fn texts(batch: &RecordBatch, column: &str) -> Vec<String> {
    let array = batch.column_by_name(column).unwrap().as_string::<i32>();
    (0..array.len()).map(|i| array.value(i).to_owned()).collect()
}

/// What is wrong with a bucket's content against the plants that left the box: every plant once, with the record that
/// the box has, its organs, its picture and its species; every key with the hash of what it names.
pub(crate) fn judge(bench: &Bench, objects: &BTreeMap<String, Vec<u8>>) -> Result<BTreeSet<String>, String> {
    let (mut plants, mut organs) = (BTreeSet::new(), BTreeSet::new());
    let files: BTreeSet<_> = objects.keys().map(|path| path.rsplit('/').next().unwrap()).collect();
    let reader = bench.store.reader().unwrap();
    for (path, bytes) in objects {
        let hash = blake3::hash(bytes).to_hex();
        let name = path.rsplit('/').next().unwrap();
        if name.split('.').next() != Some(hash.as_str()) {
            return Err(format!("{path} holds other bytes"));
        }
        for batch in if path.contains("/organs/") { rows(bytes) } else { vec![] } {
            organs.extend(texts(&batch, "plant"));
        }
        for batch in if path.contains("/plants/") { rows(bytes) } else { vec![] } {
            let records = batch.column_by_name("record").unwrap().as_binary::<i32>();
            let (species, pictures) = (texts(&batch, "species_hash"), texts(&batch, "thumbnail"));
            for (i, id) in texts(&batch, "id").into_iter().enumerate() {
                let ours = reader.record(&id).unwrap().unwrap().record;
                if ours != records.value(i) {
                    return Err(format!("{id} has another record"));
                }
                for file in [format!("{}.safetensors", species[i]), format!("{}.png", pictures[i])] {
                    if !files.contains(file.as_str()) {
                        return Err(format!("{file} of {id} is missing"));
                    }
                }
                if !plants.insert(id.clone()) {
                    return Err(format!("{id} is there twice"));
                }
            }
        }
    }
    if plants == organs { Ok(plants) } else { Err("the tables of plants and organs differ".into()) }
}
