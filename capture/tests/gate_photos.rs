//! The gate's thresholds against real photos: all pass as taken, none passes out of focus.

use std::fs;
use std::path::{Path, PathBuf};

use demeter_capture::{Gate, GateConfig, Reason, Verdict, decode_photo};
use demeter_frame::{CameraId, Frame, PixelFormat, Rgb, Stamp};

fn photos(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> = fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "jpg"))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "no photos in {}", folder.display());
    paths.truncate(31);
    paths
}

fn judge(rgb: &Rgb) -> Verdict {
    let frame = Frame {
        camera: CameraId("photo".into()),
        seq: 0,
        stamp: Stamp { mono_ns: 0, wall: String::new(), boot_id: String::new() },
        format: PixelFormat::Rgb24,
        width: rgb.width(),
        height: rgb.height(),
        stride: rgb.width() * 3,
        bytes: [0].into(),
        world_from_camera: None,
    };
    Gate::new(GateConfig::default()).judge(&frame, rgb)
}

#[test]
fn real_photos_pass_as_taken_and_not_out_of_focus() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    if !shared.exists() {
        eprintln!("SKIPPED real_photos_pass_as_taken_and_not_out_of_focus: ../shared is absent");
        return;
    }
    for set in ["field-rows/image", "maize-sideviews/CountingByDetection_FasterRCNNs", "multiview/real_plant/images"] {
        for path in photos(&shared.join("data").join(set)) {
            let rgb = decode_photo(&fs::read(&path).expect("reads")).expect("decodes");
            assert_eq!(judge(&rgb), Verdict::Pass, "{}", path.display());
            let blurred = image::imageops::blur(&rgb, 3.0);
            assert_eq!(judge(&blurred), Verdict::Refuse(Reason::Blurred), "{}", path.display());
        }
    }
}
