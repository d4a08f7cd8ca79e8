//! What the sync says to a server that it has no reason to trust: nothing.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use common::depot::{Depot, Fault};
use common::sync::{Clock, SECRET, judge, pass};
use common::{Bench, bench};
use demeter::config::SyncConfig;
use demeter::sync::MAX_REPLY;
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair, date_time_ymd};
use rustls::ServerConfig;
use rustls::pki_types::{PrivateKeyDer, PrivatePkcs8KeyDer};

/// An authority, and what it signs.
struct Authority {
    issuer: Issuer<'static, KeyPair>,
    pem: String,
}

impl Authority {
    fn new() -> Self {
        let key = KeyPair::generate().unwrap();
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let pem = params.self_signed(&key).unwrap().pem();
        Self { issuer: Issuer::new(params, key), pem }
    }

    /// A server with a certificate for `name` that ends with that year.
    fn server(&self, name: &str, year: i32) -> ServerConfig {
        let key = KeyPair::generate().unwrap();
        let mut params = CertificateParams::new(vec![name.to_owned()]).unwrap();
        params.not_before = date_time_ymd(2020, 1, 1);
        params.not_after = date_time_ymd(year, 12, 31);
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        let key = PrivateKeyDer::from(PrivatePkcs8KeyDer::from(key.serialize_der()));
        ServerConfig::builder_with_provider(Arc::new(rustls::crypto::ring::default_provider()))
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_no_client_auth()
            .with_single_cert(vec![certificate.der().clone()], key)
            .unwrap()
    }

    fn file(&self, bench: &Bench) -> PathBuf {
        let path = bench.folder.path().join("ca.pem");
        std::fs::write(&path, &self.pem).unwrap();
        path
    }
}

/// Over HTTP with a token, and to a bucket with a signature.
fn configs(bench: &Bench, depot: &Depot, authority: &Authority) -> [SyncConfig; 2] {
    let server = format!("https://localhost:{}", depot.address.port());
    let ca_file = Some(authority.file(bench));
    let http = SyncConfig { ca_file: ca_file.clone(), ..bench.config(&format!("{server}/base")) };
    let s3 = SyncConfig {
        ca_file,
        endpoint: Some(server),
        user: Some("KEYID".into()),
        ..bench.config("s3://bucket/farm/field")
    };
    [http, s3]
}

#[test]
fn tls_bad() {
    let (ours, theirs) = (Authority::new(), Authority::new());
    let cases = [
        ("expired", ours.server("localhost", 2021), "expired"),
        ("wrong authority", theirs.server("localhost", 2099), "invalid peer certificate"),
        ("wrong name", ours.server("depot.example", 2099), "not valid for name"),
    ];
    for (case, tls, why) in cases {
        let bench = bench();
        bench.fill(1..=3);
        let depot = Depot::start(Some(tls), |_| Fault::None);
        for config in configs(&bench, &depot, &ours) {
            let told = pass(&bench.syncer(&config, &Clock::new()));
            let failure = told.failure.unwrap();
            assert!(failure.contains(why), "{case}: {failure}");
            assert_eq!((told.left, depot.received()), (3, 0), "{case}: bytes behind a bad certificate");
        }
        assert!(depot.connections() > 0, "{case}: nobody came");
    }

    // A good server that sends us elsewhere, where the certificate is good too.
    let bench = bench();
    bench.fill(1..=3);
    let elsewhere = Depot::start(Some(ours.server("localhost", 2099)), |_| Fault::None);
    let there = format!("https://localhost:{}/stolen", elsewhere.address.port());
    let depot = Depot::start(Some(ours.server("localhost", 2099)), move |_| Fault::Redirect(there.clone()));
    for config in configs(&bench, &depot, &ours) {
        let told = pass(&bench.syncer(&config, &Clock::new()));
        assert_eq!((told.left, elsewhere.connections()), (3, 0), "{:?}", told.failure);
        assert!(told.failure.unwrap().contains("307"));
    }

    // Negative control: behind a good certificate the same plants, token and signature do arrive.
    depot.plan(|_| Fault::None);
    let [http, s3] = configs(&bench, &depot, &ours);
    assert_eq!(pass(&bench.syncer(&http, &Clock::new())).left, 0);
    assert!(depot.requests().iter().any(|request| request.headers.contains(SECRET)));
    bench.fill(4..=6);
    assert_eq!(pass(&bench.syncer(&s3, &Clock::new())).left, 0);
    let signed = depot.requests().into_iter().next_back().unwrap();
    assert!(signed.headers.contains("AWS4-HMAC-SHA256") && signed.headers.contains("KEYID"), "{signed:?}");
    assert!(!signed.headers.contains(SECRET), "a signature does not hold the secret");
    let objects = depot.objects();
    let bucket = objects.iter().filter(|(path, _)| path.starts_with("/bucket/farm/field/"));
    assert_eq!(judge(&bench, &bucket.map(|(k, v)| (k.clone(), v.clone())).collect()).unwrap().len(), 3);
}

#[test]
fn a_server_is_spoken_to_without_tls_on_this_machine_alone() {
    let bench = bench();
    for (url, endpoint) in [("http://depot.example/base", None), ("s3://bucket", Some("http://10.0.0.7:3900"))] {
        let config = SyncConfig { endpoint: endpoint.map(Into::into), user: Some("KEYID".into()), ..bench.config(url) };
        let error = demeter::sync::Destination::open(&config).unwrap_err().to_string();
        assert!(error.contains("https"), "{error}");
    }
    let wrong = [
        "ftp://x/y",
        "nothing",
        "https://user:hunter2@depot.example/",
        "https://depot.example/?a=b",
        "file:///no/such",
    ];
    for url in wrong {
        let error = demeter::sync::Destination::open(&bench.config(url)).unwrap_err().to_string();
        assert!(error.contains("sync.url") && !error.contains("hunter2"), "{error}");
    }
}

#[test]
fn clock_tls() {
    let ours = Authority::new();
    let bench = bench();
    bench.fill(1..=3);
    let depot = Depot::start(Some(ours.server("localhost", 2099)), |_| Fault::None);
    let [config, _] = configs(&bench, &depot, &ours);
    let clock = Clock::new();
    clock.trusted.store(false, Ordering::SeqCst);
    let told = pass(&bench.syncer(&config, &clock));
    assert_eq!((told.sent, told.left, depot.connections()), (0, 3, 0));
    let outbox = bench.store.reader().unwrap().outbox(10).unwrap();
    assert!(outbox.plants.iter().all(|plant| plant.reason.as_deref().unwrap().contains("clock")), "{outbox:?}");

    // With the right time nothing is looked at less closely: an expired certificate is still refused.
    clock.trusted.store(true, Ordering::SeqCst);
    let expired = Depot::start(Some(ours.server("localhost", 2021)), |_| Fault::None);
    let [to_expired, _] = configs(&bench, &expired, &ours);
    assert!(pass(&bench.syncer(&to_expired, &clock)).failure.unwrap().contains("expired"));
    assert_eq!(expired.received(), 0);
    assert_eq!(pass(&bench.syncer(&config, &clock)).left, 0, "and a good one taken");
}

#[test]
fn huge_reply() {
    // What the kernels of both sides hold between server and client: the program itself reads at most MAX_REPLY of it.
    const IN_FLIGHT: u64 = 16 << 20;
    for (status, announced) in [(500, true), (500, false), (200, true), (200, false), (404, true)] {
        for on in ["PUT", "GET"] {
            let bench = bench();
            bench.fill(1..=1);
            let huge = move |request: &common::depot::Request| {
                if request.method == on { Fault::Huge(status, announced) } else { Fault::None }
            };
            let depot = Depot::start(None, huge);
            let config = bench.config(&format!("http://{}/base", depot.address));
            let started = std::time::Instant::now();
            let told = pass(&bench.syncer(&config, &Clock::new()));
            let case = format!("{status} to {on}, length announced: {announced}");
            assert!(started.elapsed().as_secs() < 20, "{case}");
            assert!(depot.sent() < IN_FLIGHT + MAX_REPLY as u64, "{case}: {} bytes", depot.sent());
            assert_eq!((told.left, told.failure.is_some()), (1, true), "{case}");
        }
    }
}
