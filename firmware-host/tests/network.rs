//! When the depot's network appears, what waits is sent at once, and a server that does not answer is left in peace.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use common::depot::{Depot, Fault};
use common::sync::{judge, runtime};
use common::{Bench, bench};
use demeter::sync::{Attendant, SyncClock, attend, watch};
use jiff::{SignedDuration, Timestamp};
use tokio::sync::watch::{Sender, channel};

/// A clock that stands while anybody works and moves on when all sleep.
#[derive(Clone)]
struct Simulated {
    now: Arc<Sender<Timestamp>>,
    sleepers: Arc<Mutex<BTreeMap<u64, Timestamp>>>,
}

impl Simulated {
    fn new() -> Self {
        let now = Arc::new(channel("2026-06-01T06:00:00Z".parse().unwrap()).0);
        Self { now, sleepers: Arc::default() }
    }

    /// Moves on until then, or until `done`. The watch always sleeps in the end, the sync while it waits for a server.
    async fn advance(&self, by: Duration, done: impl Fn() -> bool) {
        let end = self.now() + by;
        while !done() {
            tokio::time::sleep(Duration::from_millis(1)).await;
            let sleepers: Vec<_> = self.sleepers.lock().unwrap().values().copied().collect();
            let Some(next) = sleepers.iter().min().filter(|_| sleepers.len() == 2) else { continue };
            self.now.send_replace(*next.min(&end));
            if *next > end {
                return;
            }
        }
    }
}

/// A sleeper that is dropped sleeps no more.
struct Sleeper<'a>(&'a Simulated, u64);

impl Drop for Sleeper<'_> {
    fn drop(&mut self) {
        self.0.sleepers.lock().unwrap().remove(&self.1);
    }
}

impl SyncClock for Simulated {
    fn now(&self) -> Timestamp {
        *self.now.borrow()
    }

    fn trusted(&self) -> bool {
        true
    }

    async fn sleep(&self, duration: Duration) {
        let (id, end) = (fastrand::u64(..), self.now() + duration);
        self.sleepers.lock().unwrap().insert(id, end);
        let _sleeper = Sleeper(self, id);
        self.now.subscribe().wait_for(|now| *now >= end).await.unwrap();
    }
}

/// /proc and /sys of a box: its routes, and whether the cable is in.
fn network(root: &Path, v4: &str, v6: &str, carrier: &str) {
    let net = root.join("proc/net");
    std::fs::create_dir_all(&net).unwrap();
    let heading = "Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT\n";
    std::fs::write(net.join("route"), format!("{heading}{v4}")).unwrap();
    std::fs::write(net.join("ipv6_route"), v6).unwrap();
    for interface in ["eth0", "lo"] {
        let folder = root.join("sys/class/net").join(interface);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("carrier"), carrier).unwrap();
    }
}

const DEPOT: &str = "eth0\t00000000\t0102A8C0\t0003\t0\t0\t100\t00000000\t0\t0\t0\n";
const DEPOT_V6: &str = "00000000000000000000000000000000 00 00000000000000000000000000000000 00 \
    fe800000000000000000000000000001 00000400 00000001 00000000 00000003     eth0\n";
/// A reject route, the loopback's own, the link's own and its groups: none leads anywhere.
const NOWHERE: &str = "eth0\t00000000\t0102A8C0\t0203\t0\t0\t100\t00000000\t0\t0\t0\n";
const NOWHERE_V6: &str = "\
    00000000000000000000000000000001 80 00000000000000000000000000000000 00 00000000000000000000000000000000 00000000 00000002 00000000 80200001       lo\n\
    fe800000000000000000000000000000 40 00000000000000000000000000000000 00 00000000000000000000000000000000 00000100 00000001 00000000 00000001     eth0\n\
    ff000000000000000000000000000000 08 00000000000000000000000000000000 00 00000000000000000000000000000000 00000100 00000002 00000000 00000001     eth0\n\
    00000000000000000000000000000000 00 00000000000000000000000000000000 00 00000000000000000000000000000000 ffffffff 00000001 00000000 00200200       lo\n";

/// A daemon's sync that has failed for two hours, so that its next try is far away.
async fn after_two_hours(bench: &Bench, root: &Path, url: &str, then: impl AsyncFnOnce(&Attendant, &Simulated)) {
    let (clock, attendant) = (Simulated::new(), Attendant::new(&bench.config(url)));
    attendant.ask();
    let story = async {
        clock.advance(Duration::from_secs(7200), || false).await;
        // At a moment when nothing would be tried for another five minutes.
        let next = || attendant.report().next.map(|next| next.parse::<Timestamp>().unwrap());
        while next().is_none_or(|next| next.duration_since(clock.now()) < SignedDuration::from_mins(5)) {
            clock.advance(Duration::from_secs(20), || false).await;
        }
        then(&attendant, &clock).await;
    };
    tokio::select! {
        () = story => {}
        never = watch(&attendant, root, &clock) => never,
        broken = attend(&attendant, (&bench.store, &bench.path), &clock) => broken.unwrap(),
    }
}

fn left(bench: &Bench) -> i64 {
    bench.number("SELECT count(*) FROM outbox")
}

#[test]
fn what_waits_is_sent_when_a_route_appears() {
    for (v4, v6) in [(DEPOT, ""), ("", DEPOT_V6)] {
        let (bench, root) = (bench(), tempfile::tempdir().unwrap());
        bench.fill(1..=3);
        network(root.path(), NOWHERE, NOWHERE_V6, "1");
        let depot = Depot::start(None, |_| Fault::Drop);
        let url = format!("http://{}/base", depot.address);
        runtime().block_on(after_two_hours(&bench, root.path(), &url, async |_, clock| {
            // The server alone, a route on a cable that is not in, or a route that goes again at once change nothing.
            depot.plan(|_| Fault::None);
            network(root.path(), v4, v6, "0");
            clock.advance(Duration::from_secs(60), || false).await;
            network(root.path(), v4, v6, "1");
            clock.advance(Duration::from_secs(6), || false).await;
            network(root.path(), NOWHERE, NOWHERE_V6, "1");
            clock.advance(Duration::from_secs(60), || false).await;
            assert_eq!(left(&bench), 3);
            // The route stays: nobody has asked, and the plants leave.
            network(root.path(), v4, v6, "1");
            let appeared = clock.now();
            clock.advance(Duration::from_secs(60), || left(&bench) == 0).await;
            assert_eq!(left(&bench), 0);
            assert!(clock.now().duration_since(appeared) < SignedDuration::from_secs(20));
        }));
        assert_eq!(judge(&bench, &depot.objects()).unwrap().len(), 3);
    }
}

#[test]
fn what_waits_is_sent_when_the_disk_appears() {
    let (bench, root) = (bench(), tempfile::tempdir().unwrap());
    bench.fill(1..=3);
    let disk = root.path().join("depot");
    let url = format!("file://{}", disk.display());
    runtime().block_on(after_two_hours(&bench, root.path(), &url, async |_, clock| {
        std::fs::create_dir(&disk).unwrap();
        clock.advance(Duration::from_secs(60), || left(&bench) == 0).await;
        assert_eq!(left(&bench), 0);
    }));
}

#[test]
fn a_route_that_comes_and_goes_makes_no_more_than_two_requests_a_minute() {
    let (bench, root) = (bench(), tempfile::tempdir().unwrap());
    bench.fill(1..=3);
    network(root.path(), NOWHERE, NOWHERE_V6, "1");
    let (depot, times) = (Depot::start(None, |_| Fault::Drop), Arc::new(Mutex::new(Vec::new())));
    let url = format!("http://{}/base", depot.address);
    runtime().block_on(after_two_hours(&bench, root.path(), &url, async |_, clock| {
        let (at, times) = (clock.clone(), times.clone());
        depot.plan(move |_| {
            times.lock().unwrap().push(at.now());
            Fault::Drop
        });
        for _ in 0..120 {
            network(root.path(), DEPOT, "", "1");
            clock.advance(Duration::from_secs(16), || false).await;
            network(root.path(), NOWHERE, NOWHERE_V6, "1");
            clock.advance(Duration::from_secs(6), || false).await;
        }
    }));
    let times = times.lock().unwrap();
    assert!(times.len() > 20, "{} requests: nothing was tried", times.len());
    let minute = SignedDuration::from_secs(60);
    assert!(times.windows(3).all(|times| times[2].duration_since(times[0]) >= minute), "{times:?}");
}
