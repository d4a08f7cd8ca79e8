//! The synthetic world in files: complete, readable, and the same from the same seed.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

use demeter_capture::{Gate, GateConfig, Pace, Replay, Source};

fn synth(arguments: &[&str], folder: &Path) -> Option<i32> {
    let output =
        Command::new(env!("CARGO_BIN_EXE_demeter")).arg("synth").args(arguments).arg("-o").arg(folder).output();
    output.unwrap().status.code()
}

#[test]
fn training_pictures_do_not_depend_on_threads_and_have_the_sizes_they_announce() {
    let folder = tempfile::tempdir().unwrap();
    let (one, three) = (folder.path().join("1"), folder.path().join("3"));
    let images = ["images", "--count", "4", "--size", "32", "--seed", "7", "--threads"];
    assert_eq!(synth(&[&images[..], &["1"]].concat(), &one), Some(0));
    assert_eq!(synth(&[&images[..], &["3"]].concat(), &three), Some(0));
    let meta: serde_json::Value = serde_json::from_slice(&std::fs::read(one.join("meta.json")).unwrap()).unwrap();
    assert_eq!([&meta["count"], &meta["height"], &meta["width"], &meta["seed"]], [4, 32, 32, 7]);
    for (name, bytes) in [("rgb.u8", 3), ("sem.u8", 1), ("dist.u8", 1), ("depth.u16", 2)] {
        let file = std::fs::read(one.join(name)).unwrap();
        assert_eq!(file.len(), 4 * 32 * 32 * bytes, "{name}");
        assert!(file == std::fs::read(three.join(name)).unwrap(), "{name} depends on the threads");
    }
    let camera = std::fs::read(one.join("camera.f32")).unwrap();
    assert!(camera == std::fs::read(three.join("camera.f32")).unwrap());
    let camera: Vec<f32> = camera.chunks(4).map(|x| f32::from_le_bytes(x.try_into().unwrap())).collect();
    assert_eq!(camera.len(), 4 * 3);
    assert!(
        camera.chunks(3).all(|x| (0.2..2.5).contains(&x[0]) && x[1].abs() <= 1.58 && x[2].abs() <= 3.15),
        "{camera:?}"
    );
    let sem = std::fs::read(one.join("sem.u8")).unwrap();
    assert!(sem.iter().all(|class| *class < 4) && sem.contains(&1), "classes 0 to 3, and some leaf");
}

#[test]
fn a_folder_of_assets_that_is_not_complete_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let (assets, pictures) = (folder.path().join("assets"), folder.path().join("pictures"));
    let assets_argument = assets.to_str().unwrap();
    let images = ["images", "--count", "1", "--size", "16", "--assets", assets_argument];
    for name in ["plants", "textures", "blades"] {
        std::fs::create_dir_all(assets.join(name)).unwrap();
    }
    assert_eq!(synth(&images, &pictures), Some(1), "no meta.json");
    std::fs::write(assets.join("meta.json"), "{}").unwrap();
    std::fs::write(assets.join("plants/maize_1.safetensors"), "no plant").unwrap();
    assert_eq!(synth(&images, &pictures), Some(1), "no plant");
    assert!(!pictures.exists());
    std::fs::remove_file(assets.join("plants/maize_1.safetensors")).unwrap();
    assert_eq!(synth(&images, &pictures), Some(0));
}

#[test]
fn a_session_is_read_back_and_every_frame_passes_the_gate() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("row");
    let arguments = ["session", "--plants", "2", "--frames", "3", "--width", "320", "--seed", "5"];
    assert_eq!(synth(&arguments, &session), Some(0));
    assert_eq!(synth(&arguments, &session), Some(1), "a session is never overwritten");
    let mut replay = Replay::open(&session, Pace::Max).unwrap();
    let mut gate = Gate::new(GateConfig::default());
    let mut frames = 0;
    while let Some(frame) = replay.next().unwrap() {
        assert!(frame.world_from_camera.is_some());
        gate.admit(&frame).unwrap();
        frames += 1;
    }
    assert_eq!(frames, 3);
    let truth: serde_json::Value = serde_json::from_slice(&std::fs::read(session.join("truth.json")).unwrap()).unwrap();
    let plants = truth["plants"].as_array().unwrap();
    assert_eq!(plants.len(), 2);
    for plant in plants {
        let blades = plant["organs"].as_array().unwrap().iter().filter(|organ| organ["kind"] == "leaf").count();
        assert_eq!(plant["blade_count"], blades);
        assert!(plant["height"].as_f64().unwrap() > 0.05);
    }
}

#[test]
fn plans_that_make_no_sense_are_bad_use() {
    let folder = tempfile::tempdir().unwrap();
    for wrong in [
        &["session", "--age", "NaN"][..],
        &["session", "--spacing", "0"],
        &["session", "--species", "triffid"],
        &["images", "--size", "4000000000"],
        &["clouds", "--noise", "-1"],
        &["plant", "--age", "2"],
    ] {
        let output = folder.path().join("never");
        assert_eq!(synth(wrong, &output), Some(2), "{wrong:?}");
        assert!(!output.exists(), "{wrong:?}");
    }
}
