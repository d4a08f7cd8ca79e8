//! Calibration files of other programs: read as those mean them, refused by key.
#![allow(clippy::unwrap_used)]

use demeter_capture::{camera_info, parse_calibration};
use demeter_frame::{Calibration, Distortion, Intrinsics};

const KALIBR: &str = "cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.02, -0.03, 0.04]
  distortion_model: equidistant
  intrinsics: [190.9, 190.8, 254.9, 256.8]
  resolution: [512, 512]
  rostopic: /cam1/image_raw
";

const ROS: &str = "image_width: 640
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [520.5, 0, 319.25, 0, 521.5, 239.75, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, -0.002, 0.05]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [520, 0, 319, 0, 0, 521, 239, 0, 0, 0, 1, 0]
";

const MESSAGE: &str = "header:
  stamp:
    sec: 5
  frame_id: left
height: 480
width: 640
distortion_model: plumb_bob
d: [0.1, -0.2, 0.001, -0.002, 0.05]
k: [520.5, 0.0, 319.25, 0.0, 521.5, 239.75, 0.0, 0.0, 1.0]
binning_x: 0
";

const OPENCV: &str = "%YAML:1.0
---
calibration_time: \"Mon 23 Nov 2026\"
image_width: 640
image_height: 480
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.205e+02, 0., 3.1925e+02, 0., 5.215e+02, 2.3975e+02,
       0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 1.0e-01, -2.0e-01, 1.0e-03, -2.0e-03, 5.0e-02 ]
avg_reprojection_error: 1.9e-01
";

const JSON: &str = r#"{"width": 640, "height": 480, "fx": 520.5, "fy": 521.5, "cx": 319.75, "cy": 240.25}"#;

fn read(text: &str) -> Result<Calibration, String> {
    parse_calibration(text.as_bytes(), None).map_err(|error| error.to_string())
}

fn ros() -> Calibration {
    // The centre of the first pixel is 0 there and 0.5 here.
    let k = Intrinsics { width: 640, height: 480, fx: 520.5, fy: 521.5, cx: 319.75, cy: 240.25 };
    Calibration::new(k, Some(Distortion::PlumbBob { coefficients: [0.1, -0.2, 0.001, -0.002, 0.05] })).unwrap()
}

#[test]
fn each_format_is_known_by_its_keys() {
    for text in [ROS, MESSAGE, &MESSAGE.replace("\nd:", "\nD:").replace("\nk:", "\nK:"), OPENCV] {
        assert_eq!(read(text).as_ref(), Ok(&ros()), "{text}");
    }
    assert_eq!(read(JSON), Ok(Calibration::new(*ros().intrinsics(), None).unwrap()));
    assert_eq!(read(&JSON.replace(' ', "\n\t")), read(JSON));
    let cam0 = parse_calibration(KALIBR.as_bytes(), Some("cam0")).unwrap();
    assert_eq!((cam0.intrinsics().width, cam0.intrinsics().cx), (752, 367.7));
    let lens = Distortion::PlumbBob { coefficients: [-0.28, 0.07, 0.0002, 1.8e-5, 0.0] };
    assert_eq!(cam0.distortion(), Some(&lens));
    let cam1 = parse_calibration(KALIBR.as_bytes(), Some("cam1")).unwrap();
    assert_eq!(cam1.distortion(), Some(&Distortion::Equidistant { coefficients: [0.01, 0.02, -0.03, 0.04] }));
    let alone = KALIBR.split("cam1:").next().unwrap();
    assert_eq!(read(alone), Ok(cam0));
    // OpenCV's own word for a fisheye, and Kalibr's and ROS' for no lens at all.
    let four = OPENCV.replace("rows: 5", "rows: 4").replace(", 5.0e-02 ]", " ]");
    let fisheye = read(&four.replace("flags: 0", "fisheye_model: 1")).unwrap();
    assert_eq!(fisheye.distortion().map(Distortion::name), Some("equidistant"));
    let none = alone.replace("radtan", "none").replace("[-0.28, 0.07, 0.0002, 1.8e-05]", "[]");
    assert_eq!(read(&none).unwrap().distortion(), None);
    let noughts = MESSAGE.replace("[0.1, -0.2, 0.001, -0.002, 0.05]", "[0, 0, 0, 0, 0]");
    assert_eq!(read(&noughts).unwrap().distortion(), None);
}

#[test]
fn what_is_wrong_is_named() {
    let ros = |from: &str, to: &str| ROS.replace(from, to);
    let chain = |from: &str, to: &str| KALIBR.split("cam1:").next().unwrap().replace(from, to);
    for (text, parts) in [
        (KALIBR.to_owned(), &["cameras", "FILE#cam0", "cam0, cam1"][..]),
        (ros("520.5", "-520.5"), &["fx", "above 1 pixel", "-520.5"]),
        (ros("520.5", ".nan"), &[".nan", "non-finite"]),
        (ros("520.5", "seven"), &["seven"]),
        (ros("520.5, ", ""), &["camera_matrix", "rows times cols numbers", "3 x 3 with 8 numbers"]),
        (ros("[520.5, 0,", "[520.5, 3,"), &["camera_matrix", "nine numbers", "3.0"]),
        (ros("plumb_bob", "rational_polynomial"), &["distortion_coefficients", "plumb_bob", "rational_polynomial"]),
        (ros("plumb_bob", "equidistant"), &["distortion_coefficients", "4 coefficients", "5 of equidistant"]),
        (ros("  cols: 5\n  data: [0.1, -0.2,", "  cols: 3\n  data: ["), &["4 or 5 coefficients", "3 of plumb_bob"]),
        (ros("[0.1, -0.2", "[-90.0, -0.2"), &["distortion", "does not fold", "-90"]),
        (ros("image_width: 640", "image_width: 0"), &["width", "1 to 16384", "0"]),
        (ros("image_width: 640", "image_width: 99999"), &["width", "1 to 16384", "99999"]),
        (ros("image_width: 640", "image_width: -640"), &["-640", "u32"]),
        (ros("image_width: 640\n", ""), &["image_width"]),
        (ros("image_width: 640\n", "image_width: 640\nimage_width: 320\n"), &["image_width"]),
        (chain("pinhole", "omni"), &["cam0.camera_model", "pinhole", "omni"]),
        (chain("radtan", "fov"), &["cam0.distortion_coeffs", "radtan", "fov"]),
        (chain("[752, 480]", "[752]"), &["cam0.resolution", "width and height", "[752]"]),
        (chain("[458.6, 457.3,", "[458.6,"), &["cam0.intrinsics", "four numbers"]),
        ("harvester: 5".into(), &["cam0", "camera_matrix", "fx", "harvester"]),
        (JSON.replace("640", "0"), &["width", "1 to 16384"]),
        (JSON.replace("fx", "f"), &["unknown field `f`"]),
        ("[1, 2".into(), &["line 1"]),
        (String::new(), &[]),
        ("\u{0}".into(), &[]),
        ("a: ".to_owned() + &"[".repeat(100_000), &[]),
        (" ".repeat(2 << 20), &["at most", "2097152"]),
    ] {
        let message = read(&text).unwrap_err();
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
    }
    let other = parse_calibration(KALIBR.as_bytes(), Some("cam2")).unwrap_err().to_string();
    assert!(other.contains("cam2") && other.contains("cam0, cam1"), "{other}");
    assert!(parse_calibration(b"\xff", None).is_err());
}

#[test]
fn what_is_written_is_read_back() {
    let k = *ros().intrinsics();
    let small = Distortion::PlumbBob { coefficients: [0.1, -0.2, 0.000_001, -0.000_000_004, 0.05] };
    let fisheye = Distortion::Equidistant { coefficients: [0.1, 0.0, -0.01, 0.002] };
    for lens in [None, Some(small), Some(fisheye)] {
        let calibration = Calibration::new(k, lens).unwrap();
        let text = camera_info(&calibration, "left");
        assert_eq!(read(&text), Ok(calibration), "{text}");
        assert!(!text.contains("e-"), "{text}");
    }
}
