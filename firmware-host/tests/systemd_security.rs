//! reliability.md 38, `systemd_security`: the units are understood, and little is left open. That inference runs under
//! MemoryDenyWriteExecute, and that every directive is in force, is shown by tests/tests/lab_service.rs.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

const UNITS: [&str; 2] = ["demeter.service", "demeter-sync.service"];

fn systemd() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../systemd")
}

fn exposure(unit: &Path) -> (bool, String) {
    let mut analyze = Command::new("systemd-analyze");
    let output =
        analyze.args(["security", "--offline=true", "--threshold=20", "--no-pager"]).arg(unit).output().unwrap();
    (output.status.success(), String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn systemd_security_exposure_is_two_at_most() {
    for unit in UNITS {
        let (well, table) = exposure(&systemd().join(unit));
        assert!(well, "{table}");
    }
    // Negative control: without one of its lines the daemon's unit is refused.
    let unit = std::fs::read_to_string(systemd().join(UNITS[0])).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let open = folder.path().join("demeter.service");
    std::fs::write(&open, unit.replace("SystemCallFilter=@system-service\n", "")).unwrap();
    assert!(!exposure(&open).0);
}

#[test]
fn systemd_security_verify_prints_nothing() {
    // The program and the other tools may stand elsewhere here; where they are is nothing that the unit gets wrong.
    let folder = tempfile::tempdir().unwrap();
    let names = ["demeter.service", "demeter-sync.service", "demeter-sync.timer"];
    let verify = |change: fn(String) -> String| {
        for name in names {
            let text = std::fs::read_to_string(systemd().join(name)).unwrap();
            let text = text.replace("/usr/bin/demeter ", &format!("{} ", env!("CARGO_BIN_EXE_demeter")));
            std::fs::write(folder.path().join(name), change(text)).unwrap();
        }
        let mut analyze = Command::new("systemd-analyze");
        analyze.args(["verify", "--man=no"]).args(names.map(|name| folder.path().join(name)));
        let output = analyze.env("SYSTEMD_LOG_LEVEL", "warning").output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8_lossy(&said).into_owned())
    };
    assert_eq!(verify(|text| text), (true, String::new()));
    // Negative control: a directive that systemd does not know.
    let (_, said) = verify(|text| text.replace("ProtectClock=", "ProtectClocks="));
    assert!(said.contains("ProtectClocks"), "{said}");
}

#[test]
fn systemd_security_units_say_what_the_specification_asks_for() {
    let unit = std::fs::read_to_string(systemd().join("demeter.service")).unwrap();
    for line in [
        "Type=notify",
        "WatchdogSec=20s",
        "Restart=always",
        "RestartPreventExitStatus=2 78",
        "RestartSec=2s",
        "StartLimitIntervalSec=0",
        "User=demeter",
        "Group=demeter",
        "SupplementaryGroups=video dialout",
        "DevicePolicy=closed",
        "DeviceAllow=char-video4linux rw",
        "DeviceAllow=char-media rw",
        "DeviceAllow=char-dma_heap rw",
        "DeviceAllow=char-ttyS rw",
        "DeviceAllow=char-ttyUSB rw",
        "DeviceAllow=char-ttyACM rw",
        "LoadCredential=demeter-sync",
        "MemoryDenyWriteExecute=yes",
        "SystemCallFilter=@system-service",
    ] {
        assert_eq!(unit.lines().filter(|found| *found == line).count(), 1, "{line}");
    }
}
