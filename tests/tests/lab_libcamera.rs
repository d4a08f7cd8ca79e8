//! A camera that only libcamera can drive (vimc, a sensor with its pipeline in the kernel), through Debian's `cam`.
#![allow(clippy::unwrap_used)]

use demeter_capture::{Pace, Replay, Source, decode};
use demeter_tests::lab::{Lab, RECORDING};
use serde_json::Value;

/// Debian's `cam` with its libraries, out of this machine's file system: the lab's own has none. udev tells it what there is.
const CAM: &str = r#"
/lib/systemd/systemd-udevd --daemon
modprobe vimc; udevadm trigger; udevadm settle
mkdir /tmp/outside; mount -t hostfs -o / none /tmp/outside
libraries=/tmp/outside/usr/lib/x86_64-linux-gnu
cat >/usr/local/bin/cam <<END
#!/bin/bash
echo \$\$ >/run/host/cam.pid
export LD_LIBRARY_PATH=$libraries:$libraries/pulseaudio LIBCAMERA_IPA_MODULE_PATH=$libraries/libcamera
exec /tmp/outside/usr/bin/cam "\$@"
END
chmod +x /usr/local/bin/cam
"#;

#[test]
fn a_camera_of_libcamera_is_recorded_and_its_child_is_started_again() {
    let Some(lab) = Lab::new("a_camera_of_libcamera_is_recorded_and_its_child_is_started_again") else { return };
    lab.put_demeter();
    // vimc scales by three, so its sizes are multiples of six.
    std::fs::write(
        lab.path("rig.toml"),
        r#"
[[cameras]]
id = "side"
device = "platform/vimc.0 Sensor B"
backend = "libcamera"
format = "rgb24"
width = 480
height = 360
rate = 5
hfov_deg = 60
height_m = 1
"#,
    )
    .unwrap();
    let script = r#"
start s "--config rig.toml"; frames s 5
# As when the camera is unplugged: the library aborts.
kill -ABRT $(cat cam.pid); said s 'camera side: cam: it ended'; said s 'frames again'
frames s 12; finish s
sed -i 's/rgb24/yuyv/' rig.toml
start other "--config rig.toml"; said other 'camera side: cam: it ended'; finish other
! ps -o stat= -C cam | grep Z
"#;
    lab.run(&format!("{RECORDING}{CAM}{script}")).ok();
    let summary: Value = serde_json::from_slice(&std::fs::read(lab.path("s.json")).unwrap()).unwrap();
    assert_eq!(summary["cameras"][0]["reopened"], 1, "{summary}");
    let mut replay = Replay::open(&lab.path("s"), Pace::Max).unwrap();
    let mut frames = 0;
    while let Some(frame) = replay.next().unwrap() {
        let picture = decode(&frame).unwrap();
        assert_eq!(picture.dimensions(), (480, 360));
        let first = picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|pixel| pixel != first), "a test pattern is not of one colour");
        frames += 1;
    }
    assert_eq!(summary["frames"], frames);
}
