//! The lab itself: what a script prints and writes comes back, and one that fails is told apart from one that hangs.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use demeter_tests::lab::Lab;

#[test]
fn the_lab_runs_scripts_and_tells_how_they_ended() {
    let Some(lab) = Lab::new("the_lab_runs_scripts_and_tells_how_they_ended") else { return };
    let console = lab.run("modprobe vivid n_devs=2 node_types=0x1; ls /dev/video0 /dev/video1; echo hello >made").ok();
    assert!(console.contains("/dev/video1"), "{console}");
    assert_eq!(std::fs::read_to_string(lab.path("made")).unwrap(), "hello\n");
    assert_eq!(lab.run("exit 7").status, 7);
    assert_eq!(lab.run("false; echo goes on").status, 1, "a command that fails ends the script");
    assert_eq!(lab.limit(Duration::from_secs(3)).run("sleep 20").status, 124);
}
