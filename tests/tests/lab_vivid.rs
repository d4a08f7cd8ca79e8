//! Cameras of the driver vivid, which fails on demand: each of its injections costs what it should and no more.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::time::Duration;

use demeter_capture::{Pace, Replay, Source};
use demeter_tests::lab::{Lab, RECORDING};
use serde_json::Value;

/// Records while vivid does something, and leaves the summary in NAME.json, the log in NAME.log and the session in NAME.
const VIVID: &str = r#"
modprobe vivid n_devs=1 node_types=0x1
vivid() { v4l2-ctl -d /dev/video0 --set-ctrl "$1"; }
"#;

fn summary(lab: &Lab, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(lab.path(&format!("{name}.json"))).unwrap()).unwrap()
}

/// The numbers of a session's frames, each of which must be readable.
fn numbers(session: &Path) -> Vec<u64> {
    let mut replay = Replay::open(session, Pace::Max).unwrap();
    let mut numbers = Vec::new();
    while let Some(frame) = replay.next().unwrap() {
        numbers.push(frame.seq);
    }
    numbers
}

#[test]
fn each_injection_of_vivid_costs_what_it_should() {
    let Some(lab) = Lab::new("each_injection_of_vivid_costs_what_it_should") else { return };
    lab.put_demeter();
    let lab = lab.limit(Duration::from_secs(150));
    let script = r#"
of="--device platform:vivid-000 --format yuyv --size 320x240 --rate 15"
# Refused while the camera is opened: the next attempt succeeds.
for call in reqbufs qbuf streamon; do
    vivid inject_vidioc_${call}_error=1
    start $call "$of"; frames $call 5; finish $call
done
start flagged "$of"; frames flagged 5
vivid inject_v4l2_buf_flag_error=1; frames flagged 10; finish flagged
start fatal "$of"; frames fatal 5
vivid inject_fatal_streaming_error=1; said fatal 'frames again'; finish fatal
vivid percentage_of_dropped_buffers=50
start dropping "$of"; frames dropping 20; finish dropping
vivid percentage_of_dropped_buffers=0
vivid wrap_sequence_number=1
start wrapping "$of"; frames wrapping 20; finish wrapping
start gone "$of"; frames gone 5
vivid disconnect=1; said gone 'frames again'
echo vivid.0 > /sys/bus/platform/drivers/vivid/unbind
said gone 'found none at all'
echo vivid.0 > /sys/bus/platform/drivers/vivid/bind
said gone 'frames again' 2; finish gone
"#;
    let console = lab.run(&format!("{RECORDING}{VIVID}{script}")).ok();
    let of = |name: &str, key: &str| summary(&lab, name)["cameras"][0][key].clone();
    let log = |name: &str| std::fs::read_to_string(lab.path(&format!("{name}.log"))).unwrap();
    for (name, what) in
        [("reqbufs", "asking for buffers"), ("qbuf", "handing over a buffer"), ("streamon", "starting the stream")]
    {
        assert!(log(name).contains(what), "{name}: {}\n{console}", log(name));
        assert_eq!((of(name, "damaged"), of(name, "reopened")), (0.into(), 0.into()), "{name}: {}", log(name));
    }
    assert_eq!((of("flagged", "damaged"), of("flagged", "reopened")), (1.into(), 0.into()), "{}", log("flagged"));
    assert_eq!(
        (of("fatal", "damaged").as_u64() <= Some(4), of("fatal", "reopened")),
        (true, 1.into()),
        "{}",
        log("fatal")
    );
    assert!(of("dropping", "missed").as_u64() >= Some(5), "{}", summary(&lab, "dropping"));
    assert_eq!(of("gone", "reopened"), 2, "{}", log("gone"));
    for name in ["reqbufs", "qbuf", "streamon", "flagged", "fatal", "dropping", "wrapping", "gone"] {
        let numbers = numbers(&lab.path(name));
        assert!(numbers.is_sorted_by(|a, b| a < b), "{name}: {numbers:?}");
        assert!(numbers.last() <= Some(&400), "{name}: nothing jumps, whatever the driver counts: {numbers:?}");
        assert_eq!(summary(&lab, name)["frames"], numbers.len() as u64, "{name}: every frame came out whole");
    }
}

#[test]
fn every_raw_format_shows_the_same_picture_and_a_wrong_one_is_refused() {
    let Some(lab) = Lab::new("every_raw_format_shows_the_same_picture_and_a_wrong_one_is_refused") else { return };
    lab.put_demeter();
    let script = r#"
modprobe vivid n_devs=2 node_types=0x1
for node in 0 1; do v4l2-ctl -d $node --set-ctrl osd_text_mode=2; done
for format in yuyv nv12 rgb24 grey; do
    demeter camera preview --device platform:vivid-001 --format $format --size 320x240 --rate 30 -o $format.png
done
demeter camera list --json >list.json
# Each goes on trying for a while, so they do it at once.
demeter camera preview --device platform:vivid-000 --format jpeg --rate 30 -o none.png 2>jpeg.log & first=$!
demeter camera preview --device platform:vivid-001 --format yuyv --rate 77 -o none.png 2>rate.log & second=$!
demeter camera preview -o none.png 2>which.log && exit 9
wait $first && exit 9
wait $second && exit 9
test ! -e none.png
"#;
    lab.run(script).ok();
    let picture =
        |name: &str| demeter_capture::decode_photo(&std::fs::read(lab.path(&format!("{name}.png"))).unwrap()).unwrap();
    let colours = picture("rgb24");
    for name in ["yuyv", "nv12"] {
        let difference: u64 = colours.iter().zip(picture(name).iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        // Bars of pure colours, which two chroma samplings blend where they meet.
        assert!(difference as f64 / (colours.len() as f64) < 4.0, "{name}: {difference}");
    }
    assert!(picture("grey").pixels().all(|pixel| pixel.0[0] == pixel.0[1] && pixel.0[1] == pixel.0[2]));
    let list: Value = serde_json::from_slice(&std::fs::read(lab.path("list.json")).unwrap()).unwrap();
    let paths: Vec<_> =
        list["cameras"].as_array().unwrap().iter().map(|camera| camera["path"].as_str().unwrap()).collect();
    assert_eq!(paths, ["platform:vivid-000", "platform:vivid-001"]);
    let said = |name: &str| std::fs::read_to_string(lab.path(name)).unwrap();
    // vivid takes the request for JPEG and gives YUYV.
    assert!(said("jpeg.log").contains("expected jpeg 640 x 480") && said("jpeg.log").contains("gives YUYV"));
    assert!(said("rate.log").contains("at 77/s, the camera gives"), "{}", said("rate.log"));
    assert!(said("which.log").contains("expected --device"), "{}", said("which.log"));
}
