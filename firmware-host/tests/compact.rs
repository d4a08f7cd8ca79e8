//! `demeter compact`: whatever it is cut by, readers of the bucket see each plant and each organ once.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path as File;
use std::process::Command;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex};

use async_trait::async_trait;
use common::depot::{Depot, Fault};
use common::sync::{Clock, judge, rows, runtime};
use common::{Bench, bench, walk};
use demeter::sync::{Compacted, Destination, Manifest, compact};
use futures_util::StreamExt;
use futures_util::stream::{self, BoxStream};
use jiff::civil::{Date, date};
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore, ObjectStoreExt,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};

type Objects = BTreeMap<String, Vec<u8>>;

/// A day on which June and July are over.
const TODAY: Date = date(2026, 8, 15);

/// Plants of June, July and August out of three rigs.
fn fill(bench: &Bench, numbers: std::ops::RangeInclusive<u32>) {
    bench.fill(numbers.clone());
    let store = rusqlite::Connection::open(&bench.path).unwrap();
    for n in numbers {
        let time = format!("2026-{:02}-{:02}T10:00:00Z", 6 + n % 3, 1 + n % 2);
        let id = format!("row-{n:04}");
        store.execute("UPDATE plants SET time = ?1 WHERE id = ?2", [time, id]).unwrap();
    }
}

/// Everything that waits is sent there, few plants in a file.
fn send(bench: &Bench, url: &str) {
    let clock = Clock::new();
    let mut syncer = bench.syncer(&bench.config(url), &clock);
    syncer.plants_a_table = 3;
    assert_eq!(runtime().block_on(syncer.pass()).unwrap().left, 0);
}

fn url(folder: &File) -> String {
    format!("file://{}", folder.display())
}

/// The bucket in a folder, as a whole.
fn objects(folder: &File) -> Objects {
    let key = |path: &File| path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
    walk(folder).into_iter().map(|path| (key(&path), std::fs::read(&path).unwrap())).collect()
}

/// What a reader takes that follows docs/sync.md: what manifests name, and the daily files that they do not name.
fn seen(objects: &Objects) -> Objects {
    let manifests = objects.iter().filter(|(key, _)| key.ends_with("/manifest.json"));
    let manifests: Vec<Manifest> = manifests.map(|(_, json)| serde_json::from_slice(json).unwrap()).collect();
    let all = || manifests.iter().flat_map(|manifest| [&manifest.plants, &manifest.organs]);
    let files: BTreeSet<_> = all().flat_map(|merged| &merged.files).collect();
    let sources: BTreeSet<_> = all().flat_map(|merged| &merged.sources).collect();
    assert!(files.iter().all(|file| objects.contains_key(*file)), "a manifest names what is not there");
    let visible =
        |key: &String| if key.starts_with("compacted/") { files.contains(key) } else { !sources.contains(key) };
    objects.iter().filter(|(key, _)| visible(key)).map(|(key, object)| (format!("/{key}"), object.clone())).collect()
}

/// Readers see every plant of the box once, with its organs.
fn assert_once(bench: &Bench, objects: &Objects, case: &str) {
    let seen = seen(objects);
    let plants = judge(bench, &seen).unwrap_or_else(|wrong| panic!("{case}: {wrong}"));
    let organs = seen.iter().filter(|(key, _)| key.contains("/organs/"));
    let organs: usize = organs.flat_map(|(_, file)| rows(file)).map(|batch| batch.num_rows()).sum();
    let ours = ["plants", "organs"].map(|table| bench.number(&format!("SELECT count(*) FROM {table}")) as usize);
    assert_eq!([plants.len(), organs], ours, "{case}");
}

/// How an operation on the store is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cut {
    Before,
    /// It was done, and nobody is told.
    After,
    /// Half of the object is there.
    Torn,
}

/// A folder whose power goes at one of its operations, and stays away.
#[derive(Debug)]
struct Power {
    folder: LocalFileSystem,
    /// Operations before the cut.
    left: Arc<AtomicI64>,
    cut: Cut,
    /// What was left at each put.
    puts: Arc<Mutex<Vec<i64>>>,
}

impl std::fmt::Display for Power {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("power")
    }
}

impl Power {
    fn cut() -> Error {
        Error::Generic { store: "power", source: "cut".into() }
    }

    /// `Ok(true)` where this is the operation that is cut.
    fn step(&self) -> Result<bool> {
        match self.left.fetch_sub(1, Ordering::SeqCst) {
            1.. => Ok(false),
            0 => Ok(true),
            _ => Err(Self::cut()),
        }
    }
}

#[async_trait]
impl ObjectStore for Power {
    async fn put_opts(&self, location: &Path, payload: PutPayload, opts: PutOptions) -> Result<PutResult> {
        self.puts.lock().unwrap().push(self.left.load(Ordering::SeqCst));
        if !self.step()? {
            return self.folder.put_opts(location, payload, opts).await;
        }
        let bytes: Vec<u8> = payload.iter().flatten().copied().collect();
        let torn = bytes[..bytes.len() / 2].to_vec();
        match self.cut {
            Cut::Before => {}
            Cut::After => drop(self.folder.put_opts(location, payload, opts).await?),
            // A manifest is there whole or not at all, as every S3 server and a rename have it; of other objects not even
            // that is taken for granted.
            Cut::Torn if location.as_ref().ends_with(".json") => {}
            Cut::Torn => drop(self.folder.put(location, torn.into()).await?),
        }
        Err(Self::cut())
    }

    async fn get_opts(&self, location: &Path, options: GetOptions) -> Result<GetResult> {
        if self.step()? { Err(Self::cut()) } else { self.folder.get_opts(location, options).await }
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        match self.step() {
            Ok(false) => self.folder.list(prefix),
            _ => stream::iter([Err(Self::cut())]).boxed(),
        }
    }

    async fn put_multipart_opts(&self, _: &Path, _: PutMultipartOptions) -> Result<Box<dyn MultipartUpload>> {
        panic!("compaction sends objects whole")
    }

    fn delete_stream(&self, _: BoxStream<'static, Result<Path>>) -> BoxStream<'static, Result<Path>> {
        panic!("compaction deletes nothing")
    }

    async fn list_with_delimiter(&self, _: Option<&Path>) -> Result<ListResult> {
        panic!("compaction lists whole folders")
    }

    async fn copy_opts(&self, _: &Path, _: &Path, _: CopyOptions) -> Result<()> {
        panic!("compaction copies nothing")
    }
}

/// Compacts a folder whose power lasts for so many operations; what was done, how many it took, and which were puts.
fn powered(folder: &File, operations: i64, cut: Cut) -> (std::result::Result<Compacted, String>, i64, Vec<i64>) {
    let (left, puts) = (Arc::new(AtomicI64::new(operations)), Arc::<Mutex<Vec<_>>>::default());
    let store = LocalFileSystem::new_with_prefix(folder).unwrap();
    let store = Power { folder: store, left: left.clone(), cut, puts: puts.clone() };
    let destination = Destination::over("power".into(), Box::new(store));
    let done = runtime().block_on(compact(&destination, TODAY)).map_err(|error| error.to_string());
    let puts = puts.lock().unwrap().iter().map(|left| operations - left).collect();
    (done, operations - left.load(Ordering::SeqCst), puts)
}

fn whole(folder: &File) -> Compacted {
    powered(folder, i64::MAX, Cut::Before).0.unwrap()
}

fn copy(from: &File, to: &File) {
    for path in walk(from) {
        let to = to.join(path.strip_prefix(from).unwrap());
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(&path, to).unwrap();
    }
}

#[test]
fn a_cut_at_any_step_gives_no_doubles_and_loses_nothing() {
    let (bench, fresh) = (bench(), tempfile::tempdir().unwrap());
    fill(&bench, 1..=12);
    send(&bench, &url(fresh.path()));
    // The same with July and June compacted, and late plants of theirs.
    let late = tempfile::tempdir().unwrap();
    copy(fresh.path(), late.path());
    whole(late.path());
    let with_late = common::bench();
    fill(&with_late, 13..=18);
    send(&with_late, &url(late.path()));
    let all = common::bench();
    fill(&all, 1..=18);

    for (start, bench) in [(&fresh, &bench), (&late, &all)] {
        let work = tempfile::tempdir().unwrap();
        copy(start.path(), work.path());
        assert_once(bench, &objects(work.path()), "before");
        let (done, steps, puts) = powered(work.path(), i64::MAX, Cut::Before);
        assert!(steps > 20 && puts.len() == 6 && done.unwrap().months.iter().all(|month| month.written));
        let after = objects(work.path());
        assert_once(bench, &after, "after");
        for step in 0..steps {
            // What reads changes nothing, however it ends.
            let cuts = if puts.contains(&step) { &[Cut::Before, Cut::After, Cut::Torn][..] } else { &[Cut::Before] };
            for &cut in cuts {
                let case = format!("{cut:?} {step} of {steps}");
                let work = tempfile::tempdir().unwrap();
                copy(start.path(), work.path());
                powered(work.path(), step, cut).0.unwrap_err();
                assert_once(bench, &objects(work.path()), &case);
                whole(work.path());
                assert_eq!(objects(work.path()), after, "{case}, and again");
            }
        }
    }
}

#[test]
fn months_that_are_over_are_merged_and_a_second_time_nothing_is_sent() {
    let (bench, folder) = (bench(), tempfile::tempdir().unwrap());
    assert_eq!(whole(folder.path()), Compacted::default(), "an empty bucket");
    fill(&bench, 1..=30);
    send(&bench, &url(folder.path()));
    let before = objects(folder.path());
    let done = whole(folder.path());
    let told: Vec<_> = done.months.iter().map(|month| (month.manifest.month.as_str(), month.written)).collect();
    assert_eq!(told, [("2026-06", true), ("2026-07", true)], "August goes on");
    for month in &done.months {
        let Manifest { plants, organs, .. } = &month.manifest;
        assert_eq!((plants.rows, plants.files.len(), organs.rows, organs.files.len()), (10, 1, 20, 1));
        assert!(plants.sources.len() > 2 && plants.sources.iter().all(|key| before.contains_key(key)));
    }
    let after = objects(folder.path());
    assert!(before.iter().all(|(key, object)| after.get(key) == Some(object)), "daily files stay as they are");
    let merged = &after[&done.months[0].manifest.plants.files[0]];
    // The same columns, with what is said of them and of the file.
    let daily = &before[&done.months[0].manifest.plants.sources[0]];
    assert_eq!(rows(merged)[0].schema(), rows(daily)[0].schema());

    let (again, ..) = powered(folder.path(), i64::MAX, Cut::Before);
    assert!(again.unwrap().months.iter().all(|month| !month.written));
    assert_eq!(objects(folder.path()), after);

    // A merged file that is gone is made again.
    std::fs::remove_file(folder.path().join(&done.months[0].manifest.plants.files[0])).unwrap();
    whole(folder.path());
    assert_eq!(objects(folder.path()), after);

    // Two at once, of which the one that saw less has the last word: late files are daily files again.
    let manifest = "compacted/month=2026-06/manifest.json";
    let late = common::bench();
    fill(&late, 31..=33);
    send(&late, &url(folder.path()));
    assert!(whole(folder.path()).months[0].written);
    std::fs::write(folder.path().join(manifest), &after[manifest]).unwrap();
    fill(&bench, 31..=33);
    assert_once(&bench, &objects(folder.path()), "two at once");
}

#[test]
fn a_damaged_daily_file_is_left_out_and_a_damaged_manifest_made_anew() {
    let (bench, folder) = (bench(), tempfile::tempdir().unwrap());
    fill(&bench, 1..=30);
    send(&bench, &url(folder.path()));
    let good = whole(folder.path());
    let manifest = folder.path().join("compacted/month=2026-06/manifest.json");
    std::fs::write(&manifest, "{\"month\":").unwrap();
    assert_eq!(whole(folder.path()).months.iter().map(|month| month.written).collect::<Vec<_>>(), [true, false]);
    assert_once(&bench, &objects(folder.path()), "made anew");

    std::fs::remove_file(&manifest).unwrap();
    let key = &good.months[0].manifest.plants.sources[1];
    let mut bytes = std::fs::read(folder.path().join(key)).unwrap();
    bytes[100] ^= 1;
    std::fs::write(folder.path().join(key), bytes).unwrap();
    let done = whole(folder.path());
    let left_out: Vec<_> = done.left_out.iter().map(|file| (&file.key, file.reason.contains("BLAKE3"))).collect();
    assert_eq!(left_out, [(key, true)]);
    assert!(!done.months[0].manifest.plants.sources.contains(key), "readers still look at it where it is");
}

#[test]
fn a_server_that_fails_now_and_then_is_compacted_in_the_end() {
    let bench = bench();
    fill(&bench, 1..=12);
    let depot = Depot::start(None, |_| Fault::None);
    let url = format!("http://{}/base", depot.address);
    send(&bench, &url);
    let elsewhere = Depot::start(None, |_| Fault::None);
    let there = format!("http://{}/stolen", elsewhere.address);
    let seed = fastrand::u64(..);
    eprintln!("seed {seed}");
    let lots = Mutex::new(fastrand::Rng::with_seed(seed));
    depot.plan(move |request| match lots.lock().unwrap().u32(0..300) {
        0 => Fault::Status(500),
        1 => Fault::Status(429),
        2 => Fault::Redirect(there.clone()),
        3 => Fault::Drop,
        4 => Fault::CommitThenDrop,
        5 => Fault::Cut,
        6 => Fault::Partial,
        7 => Fault::Garbage,
        8 => Fault::WrongAcknowledgement,
        9 if !request.path.ends_with(".json") => Fault::StoredHalf,
        _ => Fault::None,
    });
    let destination = Destination::open(&bench.config(&url)).unwrap().unwrap();
    let objects = || {
        let key = |path: String| Path::from_url_path(path.trim_start_matches("/base/")).unwrap().to_string();
        depot.objects().into_iter().map(|(path, object)| (key(path), object)).collect::<Objects>()
    };
    let mut tries = 0;
    while let Err(error) = runtime().block_on(compact(&destination, TODAY)) {
        assert_once(&bench, &objects(), &format!("after try {tries}"));
        tries += 1;
        assert!(tries < 100, "it does not converge: {error}");
    }
    assert_once(&bench, &objects(), "in the end");
    assert_eq!(elsewhere.connections(), 0, "redirects are not followed");
}

#[test]
fn the_program_says_what_it_merged() {
    let (bench, folder) = (bench(), tempfile::tempdir().unwrap());
    // The first and second of June of some year long ago.
    bench.fill(1..=6);
    let store = rusqlite::Connection::open(&bench.path).unwrap();
    store.execute("UPDATE plants SET time = replace(time, '2026', '2020')", []).unwrap();
    send(&bench, &url(folder.path()));
    let config = folder.path().join("demeter.toml");
    let program = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_demeter"));
        command.arg("compact").args(arguments).arg("--config").arg(&config).output().unwrap()
    };
    let write = |text: &str| std::fs::write(&config, text).unwrap();
    write("");
    assert_eq!(program(&[]).status.code(), Some(2), "no destination");
    write(&format!("[sync]\nurl = '{}'\ntrust_clock = true\n", url(folder.path())));
    let done = program(&["--json"]);
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    let json: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!((&json["months"][0]["month"], &json["months"][0]["plants"]["rows"]), (&"2020-06".into(), &6.into()));
    let again = String::from_utf8(program(&[]).stdout).unwrap();
    assert!(again.contains("2020-06  as before"), "{again}");
    assert_once(&bench, &objects(folder.path()).into_iter().filter(|(key, _)| key != "demeter.toml").collect(), "");

    let key = json["months"][0]["organs"]["sources"][0].as_str().unwrap();
    std::fs::write(folder.path().join(key), "no table").unwrap();
    std::fs::remove_file(folder.path().join("compacted/month=2020-06/manifest.json")).unwrap();
    assert_eq!(program(&[]).status.code(), Some(3), "a damaged file is left out");
}
