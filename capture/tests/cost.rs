//! What a camera costs this machine once its frames are in memory: figures of docs/cameras.md.

use std::path::Path;

use demeter_capture::{Gate, GateConfig, decode_photo};
use demeter_frame::{Frame, PixelFormat};
use image::imageops::{self, FilterType};

mod common;
use common::{frame, jpeg};

const RATE: f64 = 30.0;
const FRAMES: u64 = 120;

/// Time that this process was given, seconds: others on the machine do not count.
fn processor() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[test]
#[ignore = "prints figures, proves nothing: make soak"]
fn cost_of_a_camera() {
    let row = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/row/frames/side-00000003.jpg");
    let picture = decode_photo(&std::fs::read(row).expect("the fixture")).expect("decodes");
    let large = imageops::resize(&picture, 1920, 1080, FilterType::CatmullRom);
    let yuyv = picture.pixels().flat_map(|pixel| [pixel.0[1], 128]).collect::<Vec<u8>>();
    for (name, format, (width, height), bytes) in [
        ("1080p MJPEG", PixelFormat::Jpeg, large.dimensions(), jpeg(&large)),
        ("640 x 480 YUYV", PixelFormat::Yuyv, picture.dimensions(), yuyv),
    ] {
        let mut gate = Gate::new(GateConfig::default());
        let frames: Vec<Frame> = (0..FRAMES)
            .map(|i| {
                let mut bytes = bytes.clone();
                // Behind a JPEG's end or in one pixel: no two frames are the same.
                bytes.extend(i.to_le_bytes());
                let stride = format.row_bytes(width) as u32;
                Frame { format, width, height, stride, bytes: bytes.into(), ..frame(i) }
            })
            .collect();
        let started = processor();
        // A picture that was made larger is not sharp; it costs the same.
        frames.iter().for_each(|frame| drop(gate.admit(frame)));
        let seconds = (processor() - started) / FRAMES as f64;
        eprintln!("{name}: {:.2} ms a frame, {:.0} % of one core at {RATE}/s", seconds * 1e3, seconds * RATE * 100.0);
    }
}
