//! The daemon with a real camera: a webcam's frames become stored plants, and its cable is pulled meanwhile.
#![allow(clippy::unwrap_used)]

use demeter_tests::lab::{Lab, RECORDING};
use demeter_tests::root;
use serde_json::Value;

const CONFIG: &str = r#"
[store]
path = "/tmp/demeter.sqlite"
[source]
kind = "cameras"
speed_m_per_s = 0.35
spacing_m = 0.35
[[cameras]]
id = "webcam"
device = "usb-vhci_hcd.0-1"
rate = 10
hfov_deg = 42
height_m = 0.618
tilt_deg = -26.5
"#;

#[test]
fn the_daemon_makes_plants_of_a_webcam_and_goes_on_when_its_cable_is_pulled() {
    let test = "the_daemon_makes_plants_of_a_webcam_and_goes_on_when_its_cable_is_pulled";
    let Some(lab) = Lab::new(test) else { return };
    lab.put_demeter();
    lab.put_usb_camera();
    std::fs::write(lab.path("run.toml"), CONFIG).unwrap();
    let mut frames: Vec<_> = root().join("tests/fixtures/row/frames").read_dir().unwrap().flatten().collect();
    frames.sort_by_key(std::fs::DirEntry::file_name);
    let film: Vec<u8> = frames.iter().flat_map(|frame| std::fs::read(frame.path()).unwrap()).collect();
    std::fs::write(lab.path("frames.mjpg"), film).unwrap();
    let script = r#"
ip link set lo up; modprobe vhci-hcd; modprobe uvcvideo
plug() { usb-camera frames.mjpg 10 >/dev/null & webcam=$!; disown; }
ask() {
    exec 5<>/dev/tcp/127.0.0.1/8420
    printf 'GET /api/v1/status HTTP/1.1\r\nHost: 127.0.0.1:8420\r\nConnection: close\r\n\r\n' >&5
    tail -1 <&5; exec 5>&-
}
demeter run --config run.toml 2>run.log & daemon=$!
plug; wait_for 'ask 2>/dev/null | grep -q "\"state\":\"streaming\""'
wait_for '[ $(sqlite3 /tmp/demeter.sqlite "select count(*) from plants") -ge 2 ]'
kill -9 $webcam; wait_for 'ask | grep -q "camera webcam gives no frames"'; ask >pulled.json
plug; wait_for 'ask | grep -q "\"reopened\":1"'; sleep 1; ask >plugged.json
kill -TERM $daemon; wait $daemon
sqlite3 /tmp/demeter.sqlite '.backup demeter.sqlite'
"#;
    let console = lab.run(&format!("{RECORDING}{script}")).ok();
    let status = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(lab.path(name)).unwrap()).unwrap() };
    let (pulled, plugged) = (status("pulled.json"), status("plugged.json"));
    // The only camera of the rig: no plants are made without it.
    assert_eq!((&pulled["health"], &pulled["cameras"][0]["state"]), (&"broken".into(), &"lost".into()), "{pulled}");
    assert_eq!(plugged["cameras"][0]["state"], "streaming", "{plugged}\n{console}");
    let store = rusqlite::Connection::open(lab.path("demeter.sqlite")).unwrap();
    let unsent: i64 = store
        .query_row("SELECT count(*) FROM plants JOIN outbox ON outbox.plant = plants.seq", [], |row| row.get(0))
        .unwrap();
    assert!(unsent >= 2, "{unsent} plants");
}
