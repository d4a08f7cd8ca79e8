//! `demeter run` from outside: signals, exit codes, another configuration, and what its end leaves behind.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;

use common::Bench;
use common::daemon::{Daemon, LONG, command, configure, configured};
use demeter::store::Store;
use rusqlite::Connection;

/// Starts it without ONNX Runtime: no source can work.
fn without_network(bench: &Bench) -> Daemon {
    Daemon::start_with(bench.folder.path(), |command| {
        command.env("DEMETER_ONNXRUNTIME", "/no/such/library.so");
    })
}

#[test]
fn it_says_ready_answers_and_ends_well_on_each_signal_that_ends_it() {
    for signal in ["TERM", "INT", "PWR"] {
        let bench = configured(2, "");
        let daemon = without_network(&bench);
        assert!(daemon.get("/healthz").starts_with("HTTP/1.1 200"));
        let status = daemon.status();
        assert_eq!((&status["activity"]["state"], &status["health"]), (&"idle".into(), &"works".into()));
        assert!(status["rig"].as_str().unwrap().starts_with("rig-"), "{status}");
        // A client that sends nothing and never closes does not keep it.
        let _silent = daemon.idle_client();
        daemon.signal(signal);
        assert_eq!(daemon.ended(), Some(0), "{signal}");
        assert_eq!(bench.number("SELECT count(*) FROM plants"), 2);
    }
}

#[test]
fn a_source_that_cannot_start_is_said_on_the_page_and_plants_are_still_served() {
    for (source, why) in [
        ("[source]\nkind = 'replay'\nsession = 'no-such-session'", "no-such-session"),
        ("[source]\nkind = 'synthetic'\nplants = 1", "/no/such/library.so"),
        ("[source]\nkind = 'synthetic'\nspecies = 'oak'", "soybean"),
    ] {
        let bench = configured(1, source);
        let daemon = without_network(&bench);
        let status = daemon.wait_for(|status| status["health"] == "broken");
        assert_eq!(
            (&status["activity"]["state"], &status["reasons"][0]["kind"]),
            (&"failed".into(), &"pipeline".into())
        );
        assert!(status["reasons"][0]["message"].as_str().unwrap().contains(why), "{source}: {status}");
        assert!(daemon.get("/api/v1/plants/row-0001").starts_with("HTTP/1.1 200"));
        daemon.signal("TERM");
        assert_eq!(daemon.ended(), Some(0));
    }
}

#[test]
fn what_cannot_start_ends_with_the_contracts_code_and_is_never_ready() {
    let newer = |folder: &Path| {
        drop(Store::open(&folder.join("demeter.sqlite")).unwrap());
        let store = Connection::open(folder.join("demeter.sqlite")).unwrap();
        store.pragma_update(None, "user_version", 99).unwrap();
    };
    type Spoil = fn(&Path);
    let bad: [(&str, i32, Spoil); 4] = [
        ("listen_on = '127.0.0.1:0'", 2, |_| {}),
        ("", 2, |folder| std::fs::write(folder.join("demeter.sqlite"), "words".repeat(1000)).unwrap()),
        ("", 78, newer),
        ("", 1, |folder| std::fs::create_dir(folder.join("rig.json")).unwrap()),
    ];
    for (more, code, spoil) in bad {
        let folder = tempfile::tempdir().unwrap();
        configure(folder.path(), more);
        spoil(folder.path());
        let socket = common::daemon::socket(folder.path());
        socket.set_nonblocking(true).unwrap();
        let output = command(folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(socket.recv(&mut [0; 64]).is_err(), "READY before the store was open");
    }
}

#[test]
fn sighup_takes_a_good_configuration_and_refuses_a_bad_one() {
    let bench = configured(0, "");
    let daemon = without_network(&bench);
    configure(bench.folder.path(), "[lamp]\npaht = '/x'\n");
    daemon.signal("HUP");
    let status = daemon.wait_for(|status| status["health"] == "degraded");
    let reason = &status["reasons"][0];
    assert_eq!(reason["kind"], "configuration");
    assert!(reason["message"].as_str().unwrap().contains("did you mean `path`?"), "{reason}");

    let lamp = bench.folder.path().join("brightness");
    std::fs::write(&lamp, "").unwrap();
    configure(bench.folder.path(), &format!("[lamp]\npath = '{}'\n", lamp.display()));
    daemon.signal("HUP");
    daemon.wait_for(|status| status["health"] == "works");
    while std::fs::read_to_string(&lamp).unwrap() != "1" {}

    // A source that comes, and one that goes.
    configure(bench.folder.path(), "[source]\nkind = 'replay'\nsession = 'no-such-session'\n");
    daemon.signal("HUP");
    daemon.wait_for(|status| status["activity"]["state"] == "failed");
    configure(bench.folder.path(), "[store]\n");
    daemon.signal("HUP");
    daemon.wait_for(|status| status["reasons"][1]["kind"] == "configuration");
    configure(bench.folder.path(), "");
    daemon.signal("HUP");
    daemon.wait_for(|status| status["activity"]["state"] == "idle" && status["health"] == "works");
    daemon.signal("TERM");
    assert_eq!(daemon.ended(), Some(0));
    assert_eq!(std::fs::read_to_string(&lamp).unwrap(), "0");
    assert_eq!(bench.number("SELECT count(*) FROM events WHERE kind = 'configuration_refused'"), 2);
}

#[test]
fn a_stop_in_the_middle_of_work_leaves_a_clean_store() {
    let bench = configured(0, LONG);
    let daemon = Daemon::start(bench.folder.path());
    daemon.wait_for(|status| status["store"]["plants"].as_u64() > Some(1));
    let status = daemon.wait_for(|status| status["stages"][2]["busy_seconds"].is_number());
    assert_eq!(status["activity"]["state"], "working");
    daemon.signal("PWR");
    assert_eq!(daemon.ended(), Some(0));
    // Everything is in the file itself.
    let log = bench.path.with_extension("sqlite-wal");
    assert!(!log.exists() || log.metadata().unwrap().len() == 0, "the log was not written into the file");
    bench.assert_whole();
}
