//! `demeter edit` and `demeter species` as a user meets them.
#![allow(clippy::unwrap_used)]

use demeter_tests::{answer, demeter};

/// Width and height in a PNG's header.
fn size(file: &str) -> [u32; 2] {
    let bytes = std::fs::read(file).unwrap();
    assert_eq!(&bytes[1..4], b"PNG");
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
}

#[test]
fn a_plant_is_changed_and_drawn_before_and_after() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (plant, other, after, picture) = (at("a.dmtr"), at("b.dmtr"), at("after.dmtr"), at("both.png"));
    let (code, grown) = answer(&["synth", "plant", "--age", "0.3", "-o", &plant]);
    assert_eq!(code, Some(0), "{grown}");
    let organs = |answer: &serde_json::Value| answer["plants"][0]["organs"].as_array().unwrap().clone();
    let before = organs(&grown);
    let (code, edited) = answer(&[
        "edit",
        &plant,
        "--move",
        "0:scale*=1.25",
        "--bend",
        "stems=0.5",
        "--graft",
        "1:0:0.2",
        "-o",
        &after,
        "--picture",
        &picture,
    ]);
    assert_eq!(code, Some(0), "{edited}");
    assert!(organs(&edited).len() > before.len());
    assert_eq!(size(&picture), [1280, 720]);
    // What was grafted can be cut again: its organs are the last ones.
    let first = before.len().to_string();
    let (code, cut) = answer(&["edit", &after, "--cut", &first, "-o", &other]);
    assert_eq!((code, organs(&cut).len()), (Some(0), before.len()));
    let (code, half) = answer(&["edit", &plant, "--towards", &other, "--t", "0.5", "-o", &at("half.dmtr")]);
    assert_eq!((code, organs(&half).len()), (Some(0), before.len()), "{half}");
    for (arguments, code, word) in [
        (vec!["--towards", after.as_str(), "--t", "0.5"], 1, "number of organs"),
        (vec!["--cut", "0"], 1, "main stem"),
        (vec!["--move", "leaves:gamma.0=9"], 1, "3 standard deviations"),
        (vec!["--move", "petals:gamma.0=1"], 2, "petals"),
    ] {
        let unwritten = at("unwritten.dmtr");
        let mut all = vec!["edit", plant.as_str(), "-o", &unwritten];
        all.extend(arguments);
        let (found, refused) = answer(&all);
        assert_eq!(found, Some(code), "{refused}");
        assert!(refused["error"]["message"].as_str().unwrap().contains(word), "{refused}");
        assert!(!std::path::Path::new(&unwritten).exists());
    }
}

#[test]
fn species_are_listed_shown_and_exported_and_files_stand_in_for_names() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let run = |arguments: &[&str]| demeter().args(arguments).output().unwrap();
    let listed: serde_json::Value = serde_json::from_slice(&run(&["species", "list", "--json"]).stdout).unwrap();
    assert_eq!(listed.as_array().unwrap().len(), demeter_recon::species::NAMES.len());
    let (file, picture) = (at("tobacco.safetensors"), at("tobacco.png"));
    assert!(run(&["species", "export", "tobacco", "-o", &file]).status.success());
    let shown: serde_json::Value =
        serde_json::from_slice(&run(&["species", "show", &file, "--picture", &picture, "--json"]).stdout).unwrap();
    let of_name = listed.as_array().unwrap().iter().find(|species| species["name"] == "tobacco").unwrap();
    assert_eq!(&shown, of_name, "the file is the species");
    assert_eq!(size(&picture), [1200, 700]);
    let (code, grown) = answer(&["synth", "plant", "--species", &file, "--age", "0.1", "-o", &at("p.dmtr")]);
    assert_eq!((code, &grown["plants"][0]["species"]), (Some(0), &"tobacco".into()));
    let (code, refused) = answer(&["synth", "plant", "--species", &picture, "-o", &at("p.dmtr")]);
    assert_eq!(code, Some(2), "{refused}");
}
