//! What a recorder writes, a replay gives back; what cannot be a session is refused by name.

use std::fs;
use std::path::Path;

use demeter_capture::{
    Manifest, ManifestError, Pace, Reason, Recorder, Replay, SessionError, Source, SourceError, decode,
};
use demeter_frame::{CameraId, Frame, PixelFormat, Pose};
use glam::{DQuat, DVec3};
use proptest::prelude::*;

mod common;
use common::{frame, manifest};

fn record(folder: &Path, frames: &[Frame]) {
    let mut recorder = Recorder::create(folder, manifest()).expect("a new session");
    for frame in frames {
        recorder.write(frame).expect("a frame");
    }
    recorder.finish().expect("durable");
}

fn replay(folder: &Path) -> Vec<Result<Frame, SourceError>> {
    let mut source: Box<dyn Source> = Box::new(Replay::open(folder, Pace::Max).expect("a session"));
    let mut all = Vec::new();
    while let Some(hint) = source.len_hint().filter(|&left| left > 0) {
        all.push(source.next().map(|frame| frame.expect("as many as hinted")));
        assert_eq!(source.len_hint(), Some(hint - 1));
    }
    assert!(matches!(source.next(), Ok(None)));
    all
}

fn poses() -> impl Strategy<Value = Option<Pose>> {
    let number = prop_oneof![-1e3..1e3f64, Just(0.0), Just(1e-300), Just(0.1)];
    let rotation = prop::array::uniform4(-1.0..1.0f64).prop_filter("not zero", |q| q.iter().any(|v| v.abs() > 1e-3));
    prop::option::of(
        (rotation, prop::array::uniform3(number))
            .prop_map(|(q, t)| Pose::new(DQuat::from_array(q), DVec3::from_array(t))),
    )
}

fn frames() -> impl Strategy<Value = Vec<Frame>> {
    let one = (any::<bool>(), any::<u64>(), any::<bool>(), poses(), prop::collection::vec(any::<u8>(), 0..64));
    prop::collection::vec(one, 0..12).prop_map(|rows| {
        let row = |(i, (left, mono_ns, raw, world_from_camera, bytes)): (usize, (bool, u64, bool, _, Vec<u8>))| {
            let mut frame = Frame { bytes: bytes.into(), world_from_camera, ..frame(0) };
            frame.camera = CameraId(if left { "left" } else { "right" }.into());
            frame.seq = u64::MAX - i as u64 * 77;
            frame.stamp.mono_ns = mono_ns;
            frame.stamp.boot_id = if left { "session-1" } else { "boot \"2\"" }.into();
            if raw {
                (frame.format, frame.stride, frame.width) = (PixelFormat::Rgb24, 301, 100);
            }
            frame
        };
        rows.into_iter().enumerate().map(row).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever bytes a camera gives come back bit for bit, poses and all.
    #[test]
    fn what_was_recorded_is_replayed(frames in frames()) {
        let folder = tempfile::tempdir().expect("a folder");
        record(folder.path(), &frames);
        fs::write(folder.path().join("truth.json"), "not ours").expect("writes");
        let replayed: Vec<_> = replay(folder.path()).into_iter().map(|frame| frame.expect("whole")).collect();
        prop_assert_eq!(replayed, frames);
        let again = Replay::open(folder.path(), Pace::Max).expect("again");
        prop_assert_eq!(again.manifest(), &manifest());
    }

    /// Numbers in session.toml come back bit for bit.
    #[test]
    fn manifests_survive_toml(fx in 1.1..1e5f64, cx in -1e3..1e3f64, height in 1e-9..100.0f64, pose in poses()) {
        let mut written = manifest();
        written.cameras[1].intrinsics.fx = fx;
        written.cameras[1].intrinsics.cx = cx;
        written.cameras[1].height_above_ground_m = Some(height);
        written.cameras[1].rig_from_camera = pose;
        let text = written.to_toml().expect("valid");
        prop_assert_eq!(Manifest::parse(text.as_bytes()).expect("reads back"), written);
    }
}

#[test]
fn an_index_with_the_contracts_six_keys_is_enough() {
    let folder = tempfile::tempdir().expect("a folder");
    let good = frame(1);
    fs::create_dir(folder.path().join("frames")).expect("a folder");
    fs::write(folder.path().join("frames/a.jpg"), &good.bytes).expect("writes");
    fs::write(folder.path().join("session.toml"), manifest().to_toml().expect("valid")).expect("writes");
    let line = serde_json::json!({
        "camera": "left", "seq": good.seq, "t_mono_ns": good.stamp.mono_ns, "t_wall": good.stamp.wall,
        "file": "frames/a.jpg", "blake3": blake3::hash(&good.bytes).to_string(),
    });
    fs::write(folder.path().join("index.jsonl"), line.to_string()).expect("writes");
    let replayed = replay(folder.path()).remove(0).expect("whole");
    assert_eq!(replayed, good);
    assert!(decode(&replayed).is_ok());
}

#[test]
fn a_session_is_never_written_over() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path(), &[frame(1)]);
    let again = Recorder::create(folder.path(), manifest());
    assert!(matches!(again, Err(SessionError::Exists { .. })), "{again:?}");
    assert_eq!(replay(folder.path()).len(), 1);
    fs::remove_file(folder.path().join("session.toml")).expect("removes");
    assert!(
        Recorder::create(folder.path(), manifest()).is_err(),
        "an index without its session.toml is a recording too"
    );
}

#[test]
fn frames_that_no_reader_takes_are_not_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut recorder = Recorder::create(folder.path(), manifest()).expect("a new session");
    let mut bad = vec![frame(1), frame(1), frame(1), frame(1), frame(1)];
    bad[0].camera = CameraId("rear".into());
    bad[1].stamp.wall = "yesterday".into();
    bad[2].stamp.boot_id = "b".repeat(5000);
    bad[3].world_from_camera = Some(Pose { translation: DVec3::NAN, ..Pose::IDENTITY });
    bad[4].bytes = vec![0; 32 * 1024 * 1024 + 1].into();
    for frame in &bad {
        assert!(matches!(recorder.write(frame), Err(SessionError::Frame { .. })));
    }
    recorder.write(&frame(1)).expect("the good one");
    assert!(matches!(recorder.write(&frame(1)), Err(SessionError::Io { .. })), "a number is used once");
    recorder.write(&frame(2)).expect("the next one");
    recorder.finish().expect("durable");
    assert_eq!(replay(folder.path()).into_iter().filter_map(Result::ok).collect::<Vec<_>>(), [frame(1), frame(2)]);
}

#[test]
fn broken_poses_cost_the_pose_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let posed = Frame { world_from_camera: Some(Pose::IDENTITY), ..frame(2) };
    record(folder.path(), &[frame(1), posed.clone()]);
    let path = folder.path().join("poses.jsonl");
    let good = fs::read_to_string(&path).expect("reads");
    let long = good.replace("\"q\":[0.0,", "\"q\":[1.0,");
    let stranger = good.replace("left", "rear");
    fs::write(&path, format!("{{}}\n{good}{good}{long}{stranger}{}", &good[..20])).expect("writes");
    let all = replay(folder.path());
    let reasons: Vec<_> = all.iter().filter_map(|one| one.as_ref().err().and_then(SourceError::reason)).collect();
    assert_eq!(reasons, [Reason::BadPose; 5]);
    assert_eq!(all.into_iter().filter_map(Result::ok).collect::<Vec<_>>(), [frame(1), posed]);
}

#[test]
fn a_poses_file_of_garbage_is_refused_within_bounds() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path(), &[frame(1)]);
    fs::write(folder.path().join("poses.jsonl"), "garbage\n".repeat(2000)).expect("writes");
    let refused = Replay::open(folder.path(), Pace::Max);
    assert!(matches!(refused, Err(SessionError::TooMany { what: "broken lines", .. })), "{refused:?}");
}

#[test]
fn the_real_pace_gives_the_same_frames_and_cuts_forged_pauses() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut late = frame(3);
    late.stamp.mono_ns = u64::MAX;
    let frames = [frame(1), frame(2), late];
    record(folder.path(), &frames);
    let mut source = Replay::open(folder.path(), Pace::Real).expect("a session");
    for frame in frames {
        assert_eq!(source.next().expect("whole"), Some(frame));
    }
}

/// Each edit of a good session.toml is refused, and the message names the key.
#[test]
fn broken_manifests_name_the_key() {
    let good = manifest().to_toml().expect("valid");
    let edits = [
        ("schema_version = 1", "", "schema_version"),
        ("schema_version = 1", "schema_version = 0", "schema_version"),
        ("schema_version = 1", "schema_version = -1", "schema_version"),
        ("schema_version = 1", "schema_version = \"1\"", "schema_version"),
        ("rig_id = \"rig-7\"", "", "rig_id"),
        ("rig_id = \"rig-7\"", "rig_id = \"../rig\"", "rig_id"),
        ("species = \"soybean\"", "species = \"soybean\"\ncolour = 3", "colour"),
        ("species = \"soybean\"", "species = \"\"", "species"),
        ("species = \"soybean\"", "species = 4", "species"),
        ("id = \"right\"", "id = \"left\"", "cameras[1].id"),
        ("id = \"right\"", "id = \"a/b\"", "cameras[1].id"),
        ("width = 96", "width = 0", "width"),
        ("width = 96", "width = 1e9", "width"),
        ("width = 96", "depth = 96", "depth"),
        ("height = 64", "height = 99999", "height"),
        ("fy = ", "fy = nan # ", "fy"),
        ("cx = ", "cx = inf # ", "cx"),
        ("height_above_ground_m = 1.2", "height_above_ground_m = -1.2", "height_above_ground_m"),
        ("q = [0.0, 0.0, 0.0, 1.0]", "q = [0.0, 0.0, 0.0, 2.0]", "rig_from_camera"),
        ("q = [0.0, 0.0, 0.0, 1.0]", "q = [0.0, 0.0, 1.0]", "q = "),
        ("t = [0.0, 0.0, 0.0]", "t = [0.0, nan, 0.0]", "rig_from_camera"),
        ("plant_spacing_m = 0.06", "plant_spacing_m = 0.0", "rows[0].plant_spacing_m"),
        ("row = \"12\"", "row = \"\"", "rows[0].row"),
        ("row = \"12\"", "row = \"1\\n2\"", "rows[0].row"),
    ];
    for (from, to, key) in edits {
        assert!(good.contains(from), "{from} is in\n{good}");
        let error = Manifest::parse(good.replacen(from, to, 1).as_bytes()).expect_err(to);
        let mut text = error.to_string();
        let mut cause = std::error::Error::source(&error);
        while let Some(error) = cause {
            text += &format!(": {error}");
            cause = error.source();
        }
        assert!(text.contains(key), "{from} -> {to}: {text}");
    }
    let newer = Manifest::parse(b"schema_version = 2\nshape = \"unheard of\"");
    assert!(matches!(newer, Err(ManifestError::Newer { expected: 1, found: 2 })), "{newer:?}");
    for (bytes, what) in [(&b""[..], "empty"), (b"\xff\xfe", "no text"), (&[b'['; 100_000], "deep")] {
        assert!(Manifest::parse(bytes).is_err(), "{what}");
    }
    let mut bare = manifest();
    bare.cameras[0].rig_from_camera = None;
    bare.cameras[0].height_above_ground_m = None;
    assert!(bare.to_toml().is_err(), "a camera whose place is unknown");
    bare.cameras.clear();
    assert!(bare.to_toml().is_err(), "no camera");
}

#[test]
fn folders_that_are_no_session_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    assert!(matches!(Replay::open(&folder.path().join("none"), Pace::Max), Err(SessionError::Io { .. })));
    assert!(matches!(Replay::open(folder.path(), Pace::Max), Err(SessionError::File { file: "session.toml", .. })));
    fs::write(folder.path().join("session.toml"), manifest().to_toml().expect("valid")).expect("writes");
    assert!(matches!(Replay::open(folder.path(), Pace::Max), Err(SessionError::File { file: "index.jsonl", .. })));
    fs::create_dir(folder.path().join("index.jsonl")).expect("a folder");
    assert!(matches!(Replay::open(folder.path(), Pace::Max), Err(SessionError::File { file: "index.jsonl", .. })));
    let huge = fs::File::create(folder.path().join("session.toml")).expect("creates");
    huge.set_len(1 << 30).expect("sparse");
    assert!(matches!(Replay::open(folder.path(), Pace::Max), Err(SessionError::File { file: "session.toml", .. })));
}
