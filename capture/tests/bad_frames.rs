//! Bad frames of some fifty kinds in one recording: each ends in its own counter, and the good frame behind it passes.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix;
use std::path::Path;

use demeter_capture::{Gate, GateConfig, Pace, Reason, Recorder, Replay, Source, Verdict, decode};
use demeter_frame::{Frame, PixelFormat, Rgb};

mod common;
use common::{HEIGHT, WIDTH, frame, jpeg, manifest, picture, png};

/// How a good frame is spoilt.
enum Bad {
    /// As the camera gave it; the second frame is the good one before.
    Frame(fn(&mut Frame, &Frame)),
    /// In the index, after recording.
    Line(fn(&mut Vec<u8>)),
    /// In the folder, after recording.
    File(fn(&Path)),
}

fn spoil_bytes(frame: &mut Frame, spoil: impl FnOnce(&mut Vec<u8>)) {
    let mut bytes = frame.bytes.to_vec();
    spoil(&mut bytes);
    frame.bytes = bytes.into();
}

fn find(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).position(|w| w == what).expect("is there")
}

/// Sets height and width in a JPEG's frame header.
fn set_size(bytes: &mut [u8], width: u16, height: u16) {
    let at = find(bytes, &[0xff, 0xc0]) + 5;
    bytes[at..at + 2].copy_from_slice(&height.to_be_bytes());
    bytes[at + 2..at + 4].copy_from_slice(&width.to_be_bytes());
}

/// Makes the frame and scan headers of a JPEG those of a CMYK image.
fn add_component(bytes: &mut Vec<u8>) {
    let frame = find(bytes, &[0xff, 0xc0]);
    (bytes[frame + 3], bytes[frame + 9]) = (17 + 3, 4);
    bytes.splice(frame + 19..frame + 19, [4, 0x11, 0]);
    let scan = find(bytes, &[0xff, 0xda]);
    (bytes[scan + 3], bytes[scan + 4]) = (12 + 2, 4);
    bytes.splice(scan + 11..scan + 11, [4, 0]);
}

fn raw(frame: &mut Frame, stride: u32, bytes: usize) {
    raw_as(PixelFormat::Rgb24, frame, stride, bytes);
}

fn raw_as(format: PixelFormat, frame: &mut Frame, stride: u32, bytes: usize) {
    (frame.format, frame.stride) = (format, stride);
    frame.bytes = picture(frame.seq).into_raw().into_iter().cycle().take(bytes).collect();
}

fn uniform(luma: u8) -> Vec<u8> {
    jpeg(&Rgb::from_pixel(WIDTH, HEIGHT, image::Rgb([luma; 3])))
}

fn edit(line: &mut Vec<u8>, from: &str, to: &str) {
    let text = String::from_utf8(std::mem::take(line)).expect("text");
    assert!(text.contains(from), "{from} is in {text}");
    *line = text.replacen(from, to, 1).into_bytes();
}

/// The number of the good frame before.
fn same_number(line: &mut Vec<u8>) {
    let mut index: serde_json::Value = serde_json::from_slice(line).expect("JSON");
    index["seq"] = (index["seq"].as_u64().expect("a number") - 1).into();
    *line = index.to_string().into_bytes();
}

const KINDS: &[(&str, Reason, Bad)] = &[
    ("no bytes", Reason::EmptyFrame, Bad::Frame(|f, _| f.bytes = [].into())),
    ("garbage", Reason::NotAnImage, Bad::Frame(|f, _| f.bytes = b"garbage".repeat(500).into())),
    ("zeros", Reason::NotAnImage, Bad::Frame(|f, _| f.bytes = vec![0; 5000].into())),
    ("one byte", Reason::NotAnImage, Bad::Frame(|f, _| f.bytes = [0xff].into())),
    ("a PNG", Reason::NotAnImage, Bad::Frame(|f, _| f.bytes = png(&picture(f.seq)).into())),
    ("half a JPEG", Reason::TruncatedImage, Bad::Frame(|f, _| spoil_bytes(f, |b| b.truncate(b.len() / 2)))),
    ("no end marker", Reason::TruncatedImage, Bad::Frame(|f, _| spoil_bytes(f, |b| b.truncate(b.len() - 2)))),
    ("a row short", Reason::TruncatedImage, Bad::Frame(|f, _| spoil_bytes(f, |b| b.truncate(b.len() - 40)))),
    ("half a header", Reason::TruncatedImage, Bad::Frame(|f, _| spoil_bytes(f, |b| b.truncate(100)))),
    (
        "half a JPEG, padded",
        Reason::TruncatedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| {
                let half = b.len() / 2;
                b[half..].fill(0);
            })
        }),
    ),
    (
        "a start inside the scan",
        Reason::DamagedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| {
                let half = b.len() / 2;
                b[half..half + 4].copy_from_slice(&[0xff, 0xd8, 0xff, 0xd8]);
            })
        }),
    ),
    (
        "an end inside the scan",
        Reason::DamagedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| {
                let half = b.len() / 2;
                b[half..half + 2].copy_from_slice(&[0xff, 0xd9]);
            })
        }),
    ),
    (
        "half a JPEG with an end",
        Reason::DamagedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| {
                b.truncate(b.len() / 2);
                b.extend([0xff, 0xd9]);
            })
        }),
    ),
    (
        "broken Huffman table",
        Reason::DamagedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| {
                let at = find(b, &[0xff, 0xc4]) + 5;
                b[at..at + 16].fill(0xfe);
            })
        }),
    ),
    (
        "a bomb of 16384 x 16384",
        Reason::OversizedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| set_size(b, 16_384, 16_384));
        }),
    ),
    (
        "a bomb of 65535 x 65535",
        Reason::OversizedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| set_size(b, 65_535, 65_535));
        }),
    ),
    (
        "a bomb as announced",
        Reason::OversizedImage,
        Bad::Frame(|f, _| {
            (f.width, f.height) = (8000, 8000);
            spoil_bytes(f, |b| set_size(b, 8000, 8000));
        }),
    ),
    ("width 0", Reason::OversizedImage, Bad::Frame(|f, _| spoil_bytes(f, |b| set_size(b, 0, 64)))),
    ("another size", Reason::SizeMismatch, Bad::Frame(|f, _| f.width = 640)),
    ("announced as nothing", Reason::SizeMismatch, Bad::Frame(|f, _| (f.width, f.height) = (0, 0))),
    (
        "arithmetic coding",
        Reason::DamagedImage,
        Bad::Frame(|f, _| {
            spoil_bytes(f, |b| {
                let at = find(b, &[0xff, 0xc0]);
                b[at + 1] = 0xc9;
            })
        }),
    ),
    ("four colours", Reason::UnsupportedImage, Bad::Frame(|f, _| spoil_bytes(f, add_component))),
    ("raw, short stride", Reason::BadStride, Bad::Frame(|f, _| raw(f, WIDTH * 3 - 1, 96 * 64 * 3))),
    ("raw, no stride", Reason::BadStride, Bad::Frame(|f, _| raw(f, 0, 96 * 64 * 3))),
    ("raw, a byte short", Reason::TruncatedImage, Bad::Frame(|f, _| raw(f, WIDTH * 3, 96 * 64 * 3 - 1))),
    ("raw, endless stride", Reason::TruncatedImage, Bad::Frame(|f, _| raw(f, u32::MAX, 96 * 64 * 3))),
    (
        "raw, endless",
        Reason::OversizedImage,
        Bad::Frame(|f, _| {
            raw(f, u32::MAX, 96 * 64 * 3);
            (f.width, f.height) = (u32::MAX, u32::MAX);
        }),
    ),
    (
        "raw, zero rows",
        Reason::OversizedImage,
        Bad::Frame(|f, _| {
            raw(f, WIDTH * 3, 96 * 64 * 3);
            f.height = 0;
        }),
    ),
    ("yuyv, short stride", Reason::BadStride, Bad::Frame(|f, _| raw_as(PixelFormat::Yuyv, f, 191, 192 * 64))),
    ("yuyv, a byte short", Reason::TruncatedImage, Bad::Frame(|f, _| raw_as(PixelFormat::Yuyv, f, 192, 192 * 64 - 1))),
    ("nv12, short stride", Reason::BadStride, Bad::Frame(|f, _| raw_as(PixelFormat::Nv12, f, 95, 96 * 96))),
    ("nv12, no colours", Reason::TruncatedImage, Bad::Frame(|f, _| raw_as(PixelFormat::Nv12, f, 96, 96 * 64))),
    ("nv12, a byte short", Reason::TruncatedImage, Bad::Frame(|f, _| raw_as(PixelFormat::Nv12, f, 96, 96 * 96 - 1))),
    ("grey, short stride", Reason::BadStride, Bad::Frame(|f, _| raw_as(PixelFormat::Grey, f, 95, 96 * 64))),
    ("grey, a byte short", Reason::TruncatedImage, Bad::Frame(|f, _| raw_as(PixelFormat::Grey, f, 96, 96 * 64 - 1))),
    ("grey, no bytes used", Reason::EmptyFrame, Bad::Frame(|f, _| raw_as(PixelFormat::Grey, f, 96, 0))),
    ("black", Reason::Underexposed, Bad::Frame(|f, _| f.bytes = uniform(2).into())),
    ("white", Reason::Overexposed, Bad::Frame(|f, _| f.bytes = uniform(255).into())),
    ("grey", Reason::Blurred, Bad::Frame(|f, _| f.bytes = uniform(128).into())),
    (
        "out of focus",
        Reason::Blurred,
        Bad::Frame(|f, _| {
            f.bytes = jpeg(&image::imageops::blur(&picture(f.seq), 4.0)).into();
        }),
    ),
    ("the same bytes again", Reason::Duplicate, Bad::Frame(|f, before| f.bytes = before.bytes.clone())),
    ("an older number", Reason::BackwardSequence, Bad::Frame(|f, _| f.seq = 3)),
    ("the same number", Reason::BackwardSequence, Bad::Line(same_number)),
    ("an older time", Reason::BackwardTime, Bad::Frame(|f, _| f.stamp.mono_ns = 1)),
    ("the same time", Reason::BackwardTime, Bad::Frame(|f, before| f.stamp.mono_ns = before.stamp.mono_ns)),
    ("a time far ahead", Reason::StampLeap, Bad::Frame(|f, _| f.stamp.mono_ns = u64::MAX)),
    ("a number far ahead", Reason::StampLeap, Bad::Frame(|f, _| f.seq = u64::MAX)),
    ("no JSON", Reason::BadIndexLine, Bad::Line(|line| *line = b"hello".to_vec())),
    ("an empty line", Reason::BadIndexLine, Bad::Line(Vec::clear)),
    ("half a line", Reason::BadIndexLine, Bad::Line(|line| line.truncate(line.len() / 2))),
    ("an unknown key", Reason::BadIndexLine, Bad::Line(|line| edit(line, "{", "{\"colour\":1,"))),
    ("a missing key", Reason::BadIndexLine, Bad::Line(|line| edit(line, "\"camera\":\"left\",", ""))),
    ("a key twice", Reason::BadIndexLine, Bad::Line(|line| edit(line, "{", "{\"camera\":\"left\","))),
    ("a negative number", Reason::BadIndexLine, Bad::Line(|line| edit(line, "\"seq\":", "\"seq\":-"))),
    ("an unknown format", Reason::BadIndexLine, Bad::Line(|line| edit(line, "jpeg", "heif"))),
    ("no text", Reason::BadIndexLine, Bad::Line(|line| line[12] = 0xff)),
    ("deep nesting", Reason::BadIndexLine, Bad::Line(|line| *line = vec![b'['; 4000])),
    ("a long line", Reason::BadIndexLine, Bad::Line(|line| *line = vec![b' '; 3_000_000])),
    ("no wall time", Reason::BadIndexLine, Bad::Line(|line| edit(line, "2026-06-01T", "2026-16-01T"))),
    ("no hash", Reason::BadIndexLine, Bad::Line(|line| edit(line, "\"blake3\":\"", "\"blake3\":\"x"))),
    ("another camera", Reason::UnknownCamera, Bad::Line(|line| edit(line, "left", "rear"))),
    ("a way out", Reason::UnsafePath, Bad::Line(|line| edit(line, "frames/", "frames/../../"))),
    ("an absolute path", Reason::UnsafePath, Bad::Line(|line| edit(line, "frames/", "/etc/"))),
    (
        "no path",
        Reason::UnsafePath,
        Bad::Line(|line| {
            let (from, to) = (find(line, b"frames/"), find(line, b".jpg") + 4);
            line.drain(from..to);
        }),
    ),
    ("no file", Reason::MissingFile, Bad::File(|path| fs::remove_file(path).expect("removes"))),
    (
        "a folder",
        Reason::UnreadableFile,
        Bad::File(|path| {
            fs::remove_file(path).expect("removes");
            fs::create_dir(path).expect("a folder");
        }),
    ),
    (
        "a socket",
        Reason::UnreadableFile,
        Bad::File(|path| {
            fs::remove_file(path).expect("removes");
            unix::net::UnixListener::bind(path).expect("binds");
        }),
    ),
    (
        "a link out",
        Reason::UnsafePath,
        Bad::File(|path| {
            fs::remove_file(path).expect("removes");
            unix::fs::symlink("/etc/passwd", path).expect("links");
        }),
    ),
    (
        "a link to itself",
        Reason::UnreadableFile,
        Bad::File(|path| {
            fs::remove_file(path).expect("removes");
            unix::fs::symlink(path, path).expect("links");
        }),
    ),
    (
        "33 MB",
        Reason::OversizedFile,
        Bad::File(|path| {
            fs::File::options().write(true).open(path).expect("opens").set_len((32 << 20) + 1).expect("sparse");
        }),
    ),
    (
        "a flipped bit",
        Reason::HashMismatch,
        Bad::File(|path| {
            let mut bytes = fs::read(path).expect("reads");
            bytes[700] ^= 1;
            fs::write(path, bytes).expect("writes");
        }),
    ),
    (
        "a file cut short",
        Reason::HashMismatch,
        Bad::File(|path| {
            let bytes = fs::read(path).expect("reads");
            fs::write(path, &bytes[..bytes.len() / 2]).expect("writes");
        }),
    ),
    // Nothing can follow this one in its file.
    ("the last line cut", Reason::TruncatedIndexLine, Bad::Line(|line| line.truncate(line.len() / 2))),
];

/// Good and bad frames in turn, spoilt where their kind says.
fn record(folder: &Path) {
    let mut recorder = Recorder::create(folder, manifest()).expect("a new session");
    let mut spoil_later = Vec::new();
    for (i, (_, _, bad)) in KINDS.iter().enumerate() {
        let (good, mut spoilt) = (frame(2 * i as u64), frame(2 * i as u64 + 1));
        if let Bad::Frame(spoil) = bad {
            spoil(&mut spoilt, &good);
        }
        recorder.write(&good).expect("a good frame");
        recorder.write(&spoilt).expect("recorders take what cameras give");
        spoil_later.push(folder.join(format!("frames/left-{:08}.jpg", spoilt.seq)));
    }
    recorder.finish().expect("durable");
    let index = fs::read(folder.join("index.jsonl")).expect("reads");
    let mut lines: Vec<Vec<u8>> = index.split(|&b| b == b'\n').map(<[u8]>::to_vec).collect();
    assert_eq!(lines.pop(), Some(Vec::new()));
    for (i, (_, _, bad)) in KINDS.iter().enumerate() {
        match bad {
            Bad::Frame(_) => {}
            Bad::Line(spoil) => spoil(&mut lines[2 * i + 1]),
            Bad::File(spoil) => spoil(&spoil_later[i]),
        }
    }
    fs::write(folder.join("index.jsonl"), lines.join(&b'\n')).expect("writes");
}

#[test]
fn bad_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let mut source = Replay::open(folder.path(), Pace::Max).expect("a session");
    let mut gate = Gate::new(GateConfig::default());
    let mut expected = BTreeMap::new();
    let mut pull = |gate: &mut Gate| match source.next() {
        Ok(frame) => gate.admit(&frame.expect("a line a frame")).map_err(|refusal| refusal.reason()),
        Err(error) => {
            let reason = error.reason().expect("one frame only");
            gate.count(reason);
            Err(reason)
        }
    };
    for (name, reason, _) in KINDS {
        assert_eq!(pull(&mut gate).map(|_| ()), Ok(()), "the good frame before: {name}");
        assert_eq!(pull(&mut gate).map(|_| ()), Err(*reason), "{name}");
        *expected.entry(*reason).or_insert(0) += 1;
    }
    assert!(matches!(source.next(), Ok(None)));
    assert_eq!(gate.counts().refused, expected);
    assert_eq!(gate.counts().passed, KINDS.len() as u64);
    assert_eq!(gate.counts().refused_total(), KINDS.len() as u64);
    let never: Vec<_> = Reason::ALL.iter().filter(|reason| !expected.contains_key(reason)).collect();
    // Poses: tests/session.rs. What drivers mark as damaged has no frame to record: src/camera/tests.rs.
    assert_eq!(never, [&Reason::BadPose, &Reason::BadFix, &Reason::DamagedBuffer], "every other counter is reached");
}

#[test]
fn judge_says_of_decoded_frames_what_admit_says() {
    let (mut one, mut other) = (Gate::new(GateConfig::default()), Gate::new(GateConfig::default()));
    let mut black = frame(2);
    black.bytes = uniform(0).into();
    for frame in [frame(1), frame(1), black, frame(3), Frame { seq: 2000, ..frame(3) }] {
        let admitted = one.admit(&frame).map_or_else(|refusal| Verdict::Refuse(refusal.reason()), |_| Verdict::Pass);
        assert_eq!(other.judge(&frame, &decode(&frame).expect("decodes")), admitted);
    }
    assert_eq!(one.counts(), other.counts());
    assert_eq!(one.counts().passed, 2);
}

/// A stop of hours costs one frame; a new boot costs none; another camera is not concerned.
#[test]
fn leaps_are_confirmed_by_the_next_frame() {
    let mut gate = Gate::new(GateConfig::default());
    let hours = |i: u64| {
        let mut late = frame(i);
        late.stamp.mono_ns += 4 * 3_600_000_000_000;
        late
    };
    let mut reboot = frame(5);
    (reboot.seq, reboot.stamp.mono_ns, reboot.stamp.boot_id) = (0, 10, "the next".into());
    let right = Frame { camera: demeter_frame::CameraId("right".into()), ..frame(0) };
    let frames = [frame(1), hours(2), hours(3), frame(4), right, reboot];
    let found: Vec<_> = frames.iter().map(|f| gate.admit(f).map(|_| ()).map_err(|r| r.reason())).collect();
    let (leap, back) = (Err(Reason::StampLeap), Err(Reason::BackwardTime));
    assert_eq!(found, [Ok(()), leap, Ok(()), back, Ok(()), Ok(())]);
}
