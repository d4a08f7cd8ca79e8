//! The service under real systemd in the camera lab: what docs/service.md promises to an operator, in one boot.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::process::Command;
use std::time::Duration;

use demeter_tests::lab::Lab;
use demeter_tests::{demeter_path, root};
use rusqlite::Connection;

/// What each probe of lab/probe.sh came to, by its name.
fn probed(lab: &Lab, file: &str) -> BTreeMap<String, bool> {
    let text = std::fs::read_to_string(lab.path(file)).unwrap();
    let line = |line: &str| {
        let (word, name) = line.split_once(' ').unwrap();
        (name.to_owned(), word == "allowed")
    };
    text.lines().map(line).collect()
}

#[test]
fn the_service_keeps_its_promises_under_systemd() {
    let Some(lab) = Lab::new("the_service_keeps_its_promises_under_systemd") else { return };
    let lab = lab.systemd().limit(Duration::from_secs(300));
    let install = Command::new(root().join("tools/install.sh")).arg(demeter_path()).arg(lab.path("install")).status();
    assert!(install.unwrap().success());
    lab.put("probe.sh", &root().join("tests/tests/lab/probe.sh"));
    let console = lab.run(include_str!("lab/service.sh")).ok();
    assert!(console.contains(": done"), "{console}");

    // Each probe shows the sandbox: what root may do outside is denied inside, and what the service needs is not.
    let (control, sandboxed) = (probed(&lab, "control"), probed(&lab, "sandboxed"));
    assert!(control.keys().eq(sandboxed.keys()) && control.len() > 20, "{control:?}\n{sandboxed:?}");
    for (name, allowed) in sandboxed {
        assert!(control[&name], "{name} shows nothing: it is denied outside the sandbox as well");
        assert_eq!(allowed, name.starts_with("needed_"), "{name}");
    }

    // What SIGPWR and a stop left behind, without the log that was beside it.
    let store = Connection::open(lab.path("stopped.sqlite")).unwrap();
    let sound: String = store.query_row("PRAGMA integrity_check", [], |row| row.get(0)).unwrap();
    assert_eq!(sound, "ok");
    let rows =
        |table| store.query_row(&format!("SELECT count(*) FROM {table}"), [], |row| row.get::<_, u64>(0)).unwrap();
    assert!(rows("plants") >= 3 && rows("outbox") == rows("plants"));
}
