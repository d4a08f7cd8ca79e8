//! `demeter sync` and the daemon as programs: who syncs, what they say, and what they never say.
#![allow(clippy::unwrap_used)]

mod common;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use common::depot::{Depot, Fault};
use common::sync::{SECRET, judge};
use common::{Bench, bench};
use serde_json::Value;

fn configured(bench: &Bench, url: &str, port: u16) -> PathBuf {
    let path = bench.folder.path().join("demeter.toml");
    let (store, secret) = (bench.path.display(), bench.secret_file());
    let text = format!(
        "[store]\npath = '{store}'\n[api]\nlisten = '127.0.0.1:{port}'\n[sync]\nurl = '{url}'\n\
         secret_file = '{}'\ntrust_clock = true\n",
        secret.display()
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn program(config: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_demeter"));
    command.args(arguments).arg("--config").arg(config).env("RUST_LOG", "trace").stdin(Stdio::null());
    command
}

fn sync(config: &Path, arguments: &[&str]) -> Output {
    program(config, &[&["sync"], arguments].concat()).output().unwrap()
}

/// A port that was free a moment ago.
fn port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// The daemon, ready; it is killed when this goes.
struct Daemon {
    child: Child,
    log: Option<std::thread::JoinHandle<String>>,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // After `stop` it is gone already.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

impl Daemon {
    fn start(config: &Path) -> Self {
        let mut child = program(config, &["run"]).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
        let mut log = String::new();
        for line in lines.by_ref() {
            log += &line;
            if line.contains("page http") {
                break;
            }
        }
        let log = std::thread::spawn(move || lines.fold(log, |log, line| log + "\n" + &line));
        Self { child, log: Some(log) }
    }

    fn stop(mut self) -> String {
        Command::new("kill").arg(self.child.id().to_string()).status().unwrap();
        assert!(self.child.wait().unwrap().success());
        self.log.take().unwrap().join().unwrap()
    }
}

#[test]
fn a_mounted_disk_is_synced_by_the_program_alone_and_status_tells_each_reason() {
    let bench = bench();
    bench.fill(1..=5);
    let disk = tempfile::tempdir().unwrap();
    let folder = disk.path().join("demeter");
    let config = configured(&bench, &format!("file://{}", folder.display()), port());
    let json = |output: &Output| serde_json::from_slice::<Value>(&output.stdout).unwrap();
    let status = || json(&sync(&config, &["--json"]));
    assert_eq!((&status()["outbox"]["waiting"], &status()["outbox"]["plants"][0]["reason"]), (&5.into(), &Value::Null));

    // The disk is not there.
    let refused = sync(&config, &["--now"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    std::fs::create_dir(&folder).unwrap();
    let done = sync(&config, &["--now", "--json"]);
    assert_eq!((done.status.code(), &json(&done)["sent"]), (Some(0), &5.into()), "{done:?}");
    assert_eq!((&status()["outbox"]["waiting"], &status()["outbox"]["sent"]), (&0.into(), &5.into()));
    let text = sync(&config, &["--status"]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("0 plants wait, 5 have left"), "{text:?}");
    assert_eq!(sync(&config, &["--now", "--status"]).status.code(), Some(2));
}

#[test]
fn the_running_daemon_is_asked() {
    let bench = bench();
    bench.fill(1..=5);
    let depot = Depot::start(None, |_| Fault::Status(500));
    let port = port();
    let config = configured(&bench, &format!("http://{}/base", depot.address), port);
    let daemon = Daemon::start(&config);
    let failed = sync(&config, &["--now"]);
    assert_eq!(failed.status.code(), Some(3), "{failed:?}");
    assert!(String::from_utf8_lossy(&failed.stdout).contains("500"), "{failed:?}");
    let answer = String::from_utf8(get(port, "/api/v1/sync")).unwrap();
    let told: Value = serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap();
    let reasons = told["outbox"]["plants"].as_array().unwrap().iter().map(|plant| plant["reason"].as_str().unwrap());
    assert!(reasons.clone().count() == 5 && reasons.clone().all(|why| why.contains("500")), "{answer}");
    depot.plan(|_| Fault::None);
    assert_eq!(sync(&config, &["--now"]).status.code(), Some(0));
    assert_eq!(judge(&bench, &depot.objects()).unwrap().len(), 5);
    // Each pass was the daemon's: it says so, and the lock is free again.
    assert!(daemon.stop().contains("500"));
    assert_eq!(sync(&config, &["--now"]).status.code(), Some(0));

    // While somebody else syncs, the program says so and leaves it.
    let _lock = demeter::sync::Lock::take(&bench.path).unwrap();
    let locked = sync(&config, &["--now", "--json"]);
    assert_eq!(locked.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&locked.stdout).contains("sync_running"), "{locked:?}");
}

#[test]
fn the_secret_may_be_a_credential_of_systemd() {
    let bench = bench();
    bench.fill(1..=2);
    let depot = Depot::start(None, |_| Fault::None);
    let config = configured(&bench, &format!("http://{}/base", depot.address), port());
    let text = std::fs::read_to_string(&config).unwrap();
    let without: Vec<_> = text.lines().filter(|line| !line.starts_with("secret_file")).collect();
    std::fs::write(&config, without.join("\n")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("demeter-sync"), format!("{SECRET}\n")).unwrap();
    let done = program(&config, &["sync", "--now"]).env("CREDENTIALS_DIRECTORY", folder.path()).output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    let requests = depot.requests();
    assert!(!requests.is_empty() && requests.iter().all(|request| request.headers.contains(SECRET)));
}

#[test]
fn canary() {
    use std::os::unix::fs::PermissionsExt;
    let bench = bench();
    bench.fill(1..=20);
    // The server quotes our own headers back at us.
    let depot = Depot::start(None, |_| Fault::Status(500));
    let port = port();
    let config = configured(&bench, &format!("http://{}/base", depot.address), port);
    let daemon = Daemon::start(&config);
    let argv = std::fs::read(format!("/proc/{}/cmdline", daemon.child.id())).unwrap();
    let failed = sync(&config, &["--now"]);
    let client = get(port, "/api/v1/sync");
    let status = sync(&config, &["--status", "--json"]);
    depot.plan(|_| Fault::None);
    let done = sync(&config, &["--now"]);
    assert_eq!(done.status.code(), Some(0), "{done:?}");
    let log = daemon.stop();
    assert!(log.contains("(secret)"), "what the server quoted was seen and struck out");
    let mut seen = vec![argv, log.into_bytes(), client];
    for output in [failed, status, done] {
        seen.extend([output.stdout, output.stderr]);
    }
    seen.extend(depot.objects().into_values());
    for file in std::fs::read_dir(bench.folder.path()).unwrap().map(|entry| entry.unwrap().path()) {
        // Operators' group reads the store (docs/service.md), which holds no secret; the secret is its owner's alone.
        let forbidden = if file.ends_with("secret") { 0o077 } else { 0o027 };
        let mode = std::fs::metadata(&file).unwrap().permissions().mode() & forbidden;
        // Neither the configuration nor the box's name is secret.
        if !file.ends_with("demeter.toml") && !file.ends_with("rig.json") {
            assert_eq!(mode, 0, "{} can be read by others", file.display());
        }
        if !file.ends_with("secret") {
            seen.push(std::fs::read(&file).unwrap());
        }
    }
    for bytes in seen {
        assert!(!bytes.windows(SECRET.len()).any(|window| window == SECRET.as_bytes()), "the secret is out");
    }
    // Negative control: it was used.
    assert!(depot.requests().iter().all(|request| request.headers.contains(SECRET)));

    std::fs::set_permissions(bench.folder.path().join("secret"), PermissionsExt::from_mode(0o644)).unwrap();
    bench.store.save_plant(&bench.plant(99)).unwrap();
    let open = sync(&config, &["--now"]);
    assert_eq!(open.status.code(), Some(2), "a secret that others can read is refused");
    assert!(String::from_utf8_lossy(&open.stderr).contains("expected mode 0600, found 0644"));
}

fn get(port: u16, path: &str) -> Vec<u8> {
    use std::io::{Read, Write};
    let mut stream = std::net::TcpStream::connect(("127.0.0.1", port)).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    assert!(answer.starts_with(b"HTTP/1.1 200"));
    answer
}
