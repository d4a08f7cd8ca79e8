//! A replay of damaged files ends, without a panic, and gives every frame that the damage did not touch.

use std::fs;
use std::path::Path;

use demeter_capture::{Gate, GateConfig, Pace, Recorder, Replay, Source};
use demeter_frame::{Frame, Pose};
use proptest::prelude::*;
use proptest::sample::Index;

mod common;
use common::{frame, manifest};

const FRAMES: u64 = 4;

fn session(folder: &Path) -> Vec<Frame> {
    let frames: Vec<_> = (0..FRAMES).map(|i| Frame { world_from_camera: Some(Pose::IDENTITY), ..frame(i) }).collect();
    let mut recorder = Recorder::create(folder, manifest()).expect("a new session");
    frames.iter().for_each(|frame| recorder.write(frame).expect("writes"));
    recorder.finish().expect("durable");
    frames
}

/// Every frame that can be had; a source that does not end fails.
fn drain(folder: &Path, most: u64) -> Vec<Frame> {
    let Ok(mut source) = Replay::open(folder, Pace::Max) else { return Vec::new() };
    let mut gate = Gate::new(GateConfig::default());
    let mut frames = Vec::new();
    for _ in 0..most {
        match source.next() {
            Ok(Some(frame)) => {
                let admitted = gate.admit(&frame);
                assert_eq!(gate.counts().passed + gate.counts().refused_total(), frames.len() as u64 + 1);
                drop(admitted);
                frames.push(frame);
            }
            Ok(None) => return frames,
            Err(error) => assert!(error.reason().is_some(), "{error}"),
        }
    }
    panic!("the source does not end");
}

#[derive(Clone, Debug)]
enum Edit {
    Set(Index, u8),
    Cut(Index),
    Insert(Index, Vec<u8>),
    Repeat(Index, Index),
}

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    let tokens = prop::sample::select(vec![
        "\n",
        "\"",
        "{",
        "}}",
        "[[",
        ",",
        "\\u0000",
        "-",
        "1e999",
        "nan",
        "null",
        "../",
        "\u{feff}",
        "[[cameras]]\n",
    ]);
    let edit = prop_oneof![
        (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Edit::Set(at, byte)),
        any::<Index>().prop_map(Edit::Cut),
        (any::<Index>(), tokens).prop_map(|(at, token)| Edit::Insert(at, token.into())),
        (any::<Index>(), prop::collection::vec(any::<u8>(), 0..40)).prop_map(|(at, b)| Edit::Insert(at, b)),
        (any::<Index>(), any::<Index>()).prop_map(|(from, to)| Edit::Repeat(from, to)),
    ];
    prop::collection::vec(edit, 1..6)
}

fn apply(bytes: &mut Vec<u8>, edits: &[Edit]) {
    for edit in edits {
        let at = |index: &Index, bytes: &[u8]| index.index(bytes.len() + 1);
        match edit {
            Edit::Set(index, value) => {
                let at = at(index, bytes);
                bytes.get_mut(at).into_iter().for_each(|byte| *byte = *value);
            }
            Edit::Cut(index) => bytes.truncate(at(index, bytes)),
            Edit::Insert(index, piece) => {
                let at = at(index, bytes);
                bytes.splice(at..at, piece.iter().copied());
            }
            Edit::Repeat(from, to) => {
                let (a, b) = (at(from, bytes), at(to, bytes));
                bytes.extend_from_within(a.min(b)..a.max(b));
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn damaged_files_do_not_panic(file in prop::sample::select(vec!["session.toml", "index.jsonl", "poses.jsonl"]),
                                  edits in edits()) {
        let folder = tempfile::tempdir().expect("a folder");
        session(folder.path());
        let path = folder.path().join(file);
        let mut bytes = fs::read(&path).expect("reads");
        apply(&mut bytes, &edits);
        fs::write(&path, bytes).expect("writes");
        drain(folder.path(), 1000);
    }

    /// Damage inside one line of the index costs at most that frame.
    #[test]
    fn damage_stays_in_its_line(line in 0..FRAMES as usize, at in any::<Index>(), piece in prop::collection::vec(any::<u8>(), 1..20)) {
        let folder = tempfile::tempdir().expect("a folder");
        let frames = session(folder.path());
        let path = folder.path().join("index.jsonl");
        let index = fs::read(&path).expect("reads");
        let mut lines: Vec<Vec<u8>> = index.split_inclusive(|&b| b == b'\n').map(<[u8]>::to_vec).collect();
        let at = at.index(lines[line].len() - 1);
        lines[line].splice(at..=at, piece.into_iter().filter(|&b| b != b'\n'));
        fs::write(&path, lines.concat()).expect("writes");
        let left = drain(folder.path(), 1000);
        for (i, frame) in frames.iter().enumerate().filter(|(i, _)| *i != line) {
            prop_assert!(left.contains(frame), "frame {i}");
        }
    }
}
