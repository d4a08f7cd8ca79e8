//! The sync's promises: a plant leaves once, whole, and only when it was read back.
#![allow(clippy::unwrap_used)]

mod common;

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use common::depot::{Depot, Fault};
use common::sync::{Clock, judge, pass, rows, runtime, texts};
use common::{Bench, bench, walk};
use demeter::store::{Saved, StoreError};
use demeter::sync::{Attendant, Backoff, Lock, attend};

/// `full` in `make faults` (DEMETER_FAULTS=full), else `quick`.
fn many(quick: u32, full: u32) -> u32 {
    if std::env::var_os("DEMETER_FAULTS").is_some_and(|value| value == "full") { full } else { quick }
}

fn url(depot: &Depot) -> String {
    format!("http://{}/base", depot.address)
}

#[test]
fn plants_reach_a_mounted_disk_and_leave_the_outbox() {
    let bench = bench();
    bench.fill(1..=40);
    let disk = tempfile::tempdir().unwrap();
    let config = bench.config(&format!("file://{}", disk.path().display()));
    let clock = Clock::new();
    let done = pass(&bench.syncer(&config, &clock));
    assert_eq!((done.sent, done.left, done.failure), (40, 0, None));
    let mut found = std::collections::BTreeMap::new();
    for entry in walk(disk.path()) {
        let path = entry.strip_prefix(disk.path()).unwrap().to_str().unwrap().to_owned();
        found.insert(format!("/{path}"), std::fs::read(&entry).unwrap());
    }
    assert_eq!(judge(&bench, &found).unwrap().len(), 40);
    assert!(found.keys().any(|key| key.starts_with("/plants/rig=rig 1%2Fa/date=2026-06-01/")), "{:?}", found.keys());
    let outbox = bench.store.reader().unwrap().outbox(10).unwrap();
    assert_eq!((outbox.waiting, outbox.sent, outbox.plants.len()), (0, 40, 0));
    assert_eq!(outbox.last_sent.as_deref(), Some("2026-06-01T22:00:00Z"));
    assert_eq!(bench.number("SELECT count(*) FROM batches"), 0);
    assert_eq!(bench.number("SELECT count(*) FROM uploads"), 1, "the species is remembered, the rest is done with");

    // A folder that is not there is a disk that is not mounted.
    drop(disk);
    let gone = demeter::sync::Destination::open(&config).unwrap_err().to_string();
    assert!(gone.contains("sync.url") && gone.contains("mounted"), "{gone}");
}

#[test]
fn idempotent() {
    let bench = bench();
    let depot = Depot::start(None, |_| Fault::None);
    let (config, clock) = (bench.config(&url(&depot)), Clock::new());
    let plant = bench.plant(1);
    for round in 0..100 {
        let saved = bench.store.save_plant(&plant).unwrap();
        assert_eq!(saved, if round == 0 { Saved::New } else { Saved::Same });
        assert_eq!(pass(&bench.syncer(&config, &clock)).left, 0);
    }
    let objects = depot.objects();
    assert_eq!(judge(&bench, &objects).unwrap().len(), 1);
    let tables = objects.keys().filter(|key| key.contains("/plants/")).count();
    assert_eq!((tables, objects.len()), (1, 4), "{:?}", objects.keys());

    let mut other = plant.clone();
    other.report.traits.get_mut("height").unwrap().value += 0.01;
    assert!(matches!(bench.store.save_plant(&other), Err(StoreError::Conflict { .. })));
    assert_eq!(pass(&bench.syncer(&config, &clock)).sent, 0);
    assert_eq!(depot.objects(), objects);

    // Sent again after the answer was lost, it is the same object.
    bench.store.save_plant(&bench.plant(2)).unwrap();
    depot.plan(|request| if request.number % 3 == 0 { Fault::CommitThenDrop } else { Fault::None });
    while pass(&bench.syncer(&config, &clock)).left > 0 {}
    assert_eq!(judge(&bench, &depot.objects()).unwrap().len(), 2);
}

#[test]
fn what_arrived_is_told_apart_from_what_did_not() {
    let bench = bench();
    bench.fill(1..=3);
    let depot = Depot::start(None, |_| Fault::None);
    let (config, clock) = (bench.config(&url(&depot)), Clock::new());
    while pass(&bench.syncer(&config, &clock)).left > 0 {}
    let good = depot.objects();
    assert_eq!(judge(&bench, &good).unwrap().len(), 3);
    // Negative controls of the judge: each of these must be seen.
    let of = |part: &str| good.keys().find(|key| key.contains(part)).unwrap().clone();
    for part in ["/plants/", "/organs/", "/blobs/", "/species/"] {
        let mut spoilt = good.clone();
        spoilt.remove(&of(part)).unwrap();
        assert!(judge(&bench, &spoilt).map_or(true, |ids| ids.len() < 3), "{part} is gone and nobody sees it");
        let mut spoilt = good.clone();
        spoilt.get_mut(&of(part)).unwrap()[0] ^= 1;
        assert!(judge(&bench, &spoilt).is_err(), "{part} is damaged and nobody sees it");
    }
    let mut doubled = good.clone();
    doubled.insert(of("/plants/").replace("/plants/", "/again/plants/"), good[&of("/plants/")].clone());
    assert!(judge(&bench, &doubled).unwrap_err().contains("twice"));
}

#[test]
fn resume() {
    let cuts = u64::from(many(25, 100));
    let bench = bench();
    bench.fill(1..=many(60, 240));
    // Every second object is cut in the middle of its body, until there were enough.
    let sent = AtomicU64::new(0);
    let depot = Depot::start(None, move |request| {
        let nth = if request.method == "PUT" { sent.fetch_add(1, Ordering::SeqCst) } else { 0 };
        if nth % 2 == 1 && nth < 2 * cuts { Fault::Cut } else { Fault::None }
    });
    let (config, clock) = (bench.config(&url(&depot)), Clock::new());
    while pass(&bench.syncer(&config, &clock)).left > 0 {}
    let objects = depot.objects();
    assert_eq!(judge(&bench, &objects).unwrap().len(), many(60, 240) as usize);
    let puts: Vec<_> = depot.requests().into_iter().filter(|request| request.method == "PUT").collect();
    // Each cut costs its own object once more and nothing else.
    assert_eq!(puts.len() as u64, objects.len() as u64 + cuts);
    let most = objects.values().map(Vec::len).max().unwrap() as u64;
    let total: u64 = objects.values().map(|object| object.len() as u64).sum();
    assert!(most <= 1 << 20, "an object of {most} bytes is more than one chunk");
    assert!(puts.iter().map(|put| put.body as u64).sum::<u64>() <= total + cuts * most);
}

#[test]
fn backoff() {
    let bench = bench();
    bench.fill(1..=5);
    let depot = Depot::start(None, |_| Fault::Drop);
    let (config, clock) = (bench.config(&url(&depot)), Clock::new());
    let attendant = Attendant::new(&config);
    attendant.ask();
    // Ten hours without a server; in between, capture goes on and its plants are stored.
    let captured = async {
        let mut n = 100;
        while clock.waits.lock().unwrap().iter().sum::<Duration>() < Duration::from_secs(36_000) {
            bench.store.save_plant(&bench.plant(n)).unwrap();
            n += 1;
            tokio::task::yield_now().await;
        }
    };
    runtime().block_on(async {
        tokio::select! {
            () = captured => {}
            broken = attend(&attendant, (&bench.store, &bench.path), &clock) => broken.unwrap(),
        }
    });
    // Each is half a minute in which only somebody may ask, and the rest, which the network's return would end.
    let waits: Vec<Duration> = clock.waits.lock().unwrap().chunks(2).map(|halves| halves.iter().sum()).collect();
    let requests = depot.requests().len();
    assert!(requests <= waits.len() + 1, "{requests} requests in {} passes", waits.len());
    // One request a pass and at least half a minute after each: never more than two in a minute.
    assert!(waits.iter().all(|wait| *wait >= Duration::from_secs(30)), "{waits:?}");
    assert!(waits.iter().all(|wait| *wait <= Duration::from_secs(30 * 60)), "{waits:?}");
    assert!(waits.len() < 60, "{} tries in ten hours", waits.len());
    let report = attendant.report();
    assert!(report.next.is_some() && report.pass.unwrap().failure.is_some());
    let outbox = bench.store.reader().unwrap().outbox(100).unwrap();
    assert!(outbox.plants.iter().any(|plant| plant.attempts > 0 && plant.reason.is_some()));

    // Jitter: two boxes that lose the server together do not come back together.
    let all = |seed| {
        let mut backoff = Backoff::new(seed);
        (0..12).map(|_| backoff.failed()).collect::<Vec<_>>()
    };
    assert_ne!(all(1), all(2));
    let mut backoff = Backoff::new(3);
    let longest = (0..9).map(|_| backoff.failed()).max().unwrap();
    assert!(longest > Duration::from_secs(20 * 60), "{longest:?}");
    backoff.succeeded();
    assert!(backoff.failed() < Duration::from_secs(60), "what arrives ends the long waits");

    // With a server again, all of it leaves, those that were captured meanwhile too.
    depot.plan(|_| Fault::None);
    while pass(&bench.syncer(&config, &clock)).left > 0 {}
    assert_eq!(judge(&bench, &depot.objects()).unwrap().len() as i64, bench.number("SELECT count(*) FROM plants"));
}

#[test]
fn sync_chaos() {
    let seed = std::env::var("DEMETER_SEED").map_or_else(|_| fastrand::u64(..), |seed| seed.parse().unwrap());
    eprintln!("seed {seed}: DEMETER_SEED={seed} repeats it");
    let records = many(300, 10_000);
    let bench = bench();
    bench.fill(1..=records / 2);
    let elsewhere = Depot::start(None, |_| Fault::None);
    let there = format!("http://{}/stolen", elsewhere.address);
    let lots = std::sync::Mutex::new(fastrand::Rng::with_seed(seed));
    let depot = Depot::start(None, move |_| {
        let mut lots = lots.lock().unwrap();
        // Three of ten requests go wrong.
        match lots.u32(0..100) {
            0..3 => Fault::Status([500, 503, 429, 403, 404, 409][lots.usize(0..6)]),
            3..6 => Fault::Redirect(there.clone()),
            6..9 => Fault::Drop,
            9..12 => Fault::Cut,
            12..15 => Fault::CommitThenDrop,
            15..18 => Fault::WrongAcknowledgement,
            18..21 => Fault::StoredHalf,
            21..24 => Fault::Partial,
            24..27 => Fault::Flipped,
            27..29 => Fault::Garbage,
            29..30 => Fault::Slow,
            _ => Fault::None,
        }
    });
    let (config, clock) = (bench.config(&url(&depot)), Clock::new());
    let mut lots = fastrand::Rng::with_seed(seed ^ 1);
    let (mut next, mut passes) = (records / 2 + 1, 0);
    loop {
        // Power cuts: a pass is dropped wherever it is, and every pass starts from the file.
        let syncer = bench.syncer(&config, &clock);
        let cut = Duration::from_millis(if lots.u32(0..4) == 0 { lots.u64(1..50) } else { 60_000 });
        let outcome = runtime().block_on(async { tokio::time::timeout(cut, syncer.pass()).await });
        passes += 1;
        // Plants come while others are on their way.
        let end = (next + lots.u32(0..records / 20)).min(records + 1);
        bench.fill(next..=end - 1);
        next = end;
        if next > records && outcome.is_ok_and(|pass| pass.unwrap().left == 0) {
            break;
        }
        assert!(passes < 100_000, "it does not converge");
    }
    eprintln!("{records} plants, {passes} passes, {} requests", depot.requests().len());
    // What half-stored answers left under a key was replaced before its row retired.
    let stored = judge(&bench, &depot.objects()).unwrap();
    assert_eq!(stored.len() as u32, records, "server set = device set");
    assert_eq!(bench.number("SELECT count(*) FROM outbox"), 0);
    assert_eq!(bench.number("SELECT count(*) FROM sent"), i64::from(records));
    assert_eq!(elsewhere.connections(), 0, "redirects are not followed");
}

#[test]
fn only_one_syncs_a_store() {
    let bench = bench();
    let lock = Lock::take(&bench.path).unwrap();
    assert!(Lock::take(&bench.path).unwrap_err().to_string().contains("sync-lock"));
    drop(lock);
    Lock::take(&bench.path).unwrap();
}

#[test]
fn a_batch_that_never_arrives_does_not_hold_up_the_others() {
    let bench = bench();
    bench.fill(1..=4);
    let depot = Depot::start(None, |_| Fault::None);
    let (config, clock) = (bench.config(&url(&depot)), Clock::new());
    // The first table of rig 1 is always refused.
    let poison = |path: &str| path.contains("rig%201") || path.contains("rig 1");
    depot.plan(move |request| if poison(&request.path) { Fault::Status(413) } else { Fault::None });
    for _ in 0..12 {
        pass(&bench.syncer(&config, &clock));
    }
    let outbox = bench.store.reader().unwrap().outbox(10).unwrap();
    let waiting: Vec<_> = outbox.plants.iter().map(|plant| plant.id.as_str()).collect();
    assert_eq!((waiting, outbox.sent), (vec!["row-0001", "row-0004"], 2));
    let reason = outbox.plants[0].reason.clone().unwrap();
    assert!(reason.contains("413") && outbox.plants[0].attempts >= 8, "{reason}");
    assert!(!reason.contains(common::sync::SECRET), "the server quotes our token, we do not: {reason}");
    depot.plan(|_| Fault::None);
    while pass(&bench.syncer(&config, &clock)).left > 0 {}
}

#[test]
fn tables_of_an_older_program_are_sent_as_they_are() {
    let bench = bench();
    bench.fill(1..=2);
    let depot = Depot::start(None, |request| if request.path.contains("/plants/") { Fault::Drop } else { Fault::None });
    let (config, clock) = (bench.config(&url(&depot)), Clock::new());
    pass(&bench.syncer(&config, &clock));
    let keys = |bench: &Bench| {
        let reader = bench.store.reader().unwrap();
        reader.batches().unwrap().iter().map(|(batch, _)| reader.batch(*batch).unwrap().plants_key).collect::<Vec<_>>()
    };
    let before = keys(&bench);
    assert_eq!(before.len(), 1);
    bench.fill(3..=9);
    depot.plan(|_| Fault::None);
    while pass(&bench.syncer(&config, &clock)).left > 0 {}
    let objects = depot.objects();
    let first = objects.iter().find(|(path, _)| path.ends_with(before[0].rsplit('/').next().unwrap())).unwrap();
    assert_eq!(texts(&rows(first.1)[0], "id"), ["row-0001"], "later plants did not change the table on its way");
}
