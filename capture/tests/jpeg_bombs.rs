//! spec/reliability.md 24: a small file that announces a huge picture is refused by its header. What that costs is
//! measured by the clock and the kernel, so it is asserted in `make soak` alone.

use std::time::{Duration, Instant};

use demeter_capture::{DecodeError, decode, decode_photo};
use demeter_frame::Frame;

mod common;
use common::{frame, jpeg, picture};

/// The JPEG of a small picture whose frame header, of that kind (ffc0 plain, ffc2 progressive), announces another size,
/// cut off behind its first scan's header or not.
fn bomb(kind: u8, width: u16, height: u16, cut: bool) -> Vec<u8> {
    let mut bytes = jpeg(&picture(1));
    let at = |bytes: &[u8], marker: u8| bytes.windows(2).position(|w| w == [0xff, marker]).expect("is there");
    let header = at(&bytes, 0xc0);
    bytes[header + 1] = kind;
    bytes[header + 5..header + 7].copy_from_slice(&height.to_be_bytes());
    bytes[header + 7..header + 9].copy_from_slice(&width.to_be_bytes());
    if cut {
        let scan = at(&bytes, 0xda);
        bytes.truncate(scan + 14);
    }
    bytes
}

/// The most memory this process ever held, bytes.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|line| line.starts_with("VmHWM")).expect("is there");
    line.split_whitespace().nth(1).and_then(|kib| kib.parse::<u64>().ok()).expect("KiB") * 1024
}

#[test]
fn jpeg_bombs() {
    // The first picture pays for tables and code that stay.
    decode(&frame(1)).expect("decodes");
    let before = peak();
    for kind in [0xc0, 0xc1, 0xc2] {
        for (width, height) in
            [(65_535, 65_535), (65_535, 1), (1, 65_535), (16_385, 16), (16_384, 16_384), (4001, 4000)]
        {
            for cut in [false, true] {
                let bytes = bomb(kind, width, height, cut);
                let started = Instant::now();
                let announced = Frame { width: width.into(), height: height.into(), ..frame(1) };
                let refused = [decode_photo(&bytes), decode(&Frame { bytes: bytes.into(), ..announced })];
                let took = started.elapsed();
                for refused in refused {
                    let expected = (u32::from(width), u32::from(height));
                    let found =
                        matches!(refused, Err(DecodeError::Oversized { width, height }) if (width, height) == expected);
                    assert!(found, "{kind:x} {width} x {height} {cut}: {refused:?}");
                }
                if std::env::var_os("DEMETER_SOAK").is_some() {
                    assert!(took <= 2 * Duration::from_millis(10), "two refusals took {took:?}");
                }
            }
        }
    }
    let more = peak() - before;
    eprintln!("36 bombs twice: {more} bytes more than one small picture");
    if std::env::var_os("DEMETER_SOAK").is_some() {
        assert!(more <= 8 << 20, "{more} bytes");
    }
}
