//! `demeter photo` on real photographs and on files that are none: a plant, or a typed reason, never a crash.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use demeter_tests::{answer, recorded, root, shared};
use serde_json::Value;

/// Every `step`-th photo of a folder, by name.
fn photos(folder: &Path, step: usize) -> Vec<PathBuf> {
    let all = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut photos: Vec<PathBuf> = all.filter(|path| path.extension().is_some_and(|e| e == "jpg")).collect();
    photos.sort();
    assert!(photos.len() > step, "{} holds too few photos", folder.display());
    photos.into_iter().step_by(step).collect()
}

fn blades(plant: &Value) -> usize {
    plant["organs"].as_array().unwrap().iter().filter(|organ| organ["kind"] == "leaf").count()
}

#[test]
fn real_maize_has_three_blades_in_at_least_60_percent() {
    let test = "real_maize_has_three_blades_in_at_least_60_percent";
    let Some(folder) = shared(test, "data/maize-sideviews/CountingByRegression_CNNs") else { return };
    let photos = photos(&folder, 12);
    let mut good = 0;
    for photo in &photos {
        let (code, found) = answer(&["photo", photo.to_str().unwrap(), "--species", "maize"]);
        match code {
            Some(0) => {
                let plant = &found["plants"][0];
                assert_eq!(plant["scale_source"], "none", "one photo tells no metres");
                assert!(plant["traits"].get("height").is_none(), "so none are told");
                good += usize::from(blades(plant) >= 3);
            }
            _ => assert!(found["error"]["kind"].is_string(), "{}: {found}", photo.display()),
        }
    }
    eprintln!("{good} of {} photos with 3 blades or more", photos.len());
    assert!(10 * good >= 6 * photos.len(), "{good} of {}", photos.len());
}

#[test]
fn field_rows_give_plants_or_a_reason() {
    let Some(folder) = shared("field_rows_give_plants_or_a_reason", "data/field-rows/image") else { return };
    let out = tempfile::tempdir().unwrap();
    for (i, photo) in photos(&folder, 6).iter().enumerate() {
        let records = out.path().join(i.to_string());
        let (code, found) = answer(&["photo", photo.to_str().unwrap(), "--all", "-o", records.to_str().unwrap()]);
        match found["plants"].as_array() {
            Some(plants) => {
                assert!(matches!(code, Some(0 | 3)), "{}", photo.display());
                assert_eq!(std::fs::read_dir(&records).unwrap().count(), plants.len(), "one record a plant");
            }
            None => assert!(code == Some(1) && found["error"]["kind"].is_string(), "{}: {found}", photo.display()),
        }
    }
}

#[test]
fn a_frame_of_the_bundled_session_is_a_photo_too() {
    let frame = photos(&root().join("tests/fixtures/row/frames"), 10)[1].clone();
    let out = tempfile::tempdir().unwrap();
    let at = |name: &str| out.path().join(name).to_str().unwrap().to_owned();
    let (mesh, overlay, record) = (at("plant.glb"), at("over.png"), at("plant.dmtr"));
    let (code, found) = answer(&[
        "photo",
        frame.to_str().unwrap(),
        "--hfov",
        "42",
        "-o",
        &record,
        "--mesh",
        &mesh,
        "--overlay",
        &overlay,
    ]);
    assert_eq!(code, Some(0), "{found}");
    assert_eq!(found["plants"][0]["camera"]["width"], 640);
    assert_eq!(&std::fs::read(mesh).unwrap()[..4], b"glTF");
    assert_eq!(&std::fs::read(overlay).unwrap()[1..4], b"PNG");
    let (_, decoded) = answer(&["decode", &record]);
    assert_eq!(recorded(&decoded["plants"][0]["traits"]), recorded(&found["plants"][0]["traits"]));
}

#[test]
fn what_is_no_photo_ends_with_a_reason() {
    let out = tempfile::tempdir().unwrap();
    let frame = std::fs::read(&photos(&root().join("tests/fixtures/row/frames"), 10)[0]).unwrap();
    let mut black = Vec::new();
    image::DynamicImage::new_rgb8(64, 48)
        .write_to(&mut std::io::Cursor::new(&mut black), image::ImageFormat::Png)
        .unwrap();
    let mut huge = frame.clone();
    // The size in the frame header (SOF0): 65,535 by 65,535.
    let header = huge.windows(2).position(|w| w == [0xFF, 0xC0]).unwrap();
    huge[header + 5..header + 9].fill(0xFF);
    for (name, bytes, kind) in [
        ("empty", Vec::new(), "bad_image"),
        ("text", b"not a picture".to_vec(), "bad_image"),
        ("half", frame[..frame.len() / 2].to_vec(), "bad_image"),
        ("huge", huge, "bad_image"),
        ("black", black, "no_plant"),
    ] {
        let path = out.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let (code, refused) = answer(&["photo", path.to_str().unwrap()]);
        assert_eq!((code, refused["error"]["kind"].as_str()), (Some(1), Some(kind)), "{name}: {refused}");
    }
    let (code, refused) = answer(&["photo", "/nonexistent.jpg"]);
    assert_eq!((code, refused["error"]["kind"].as_str()), (Some(1), Some("file")), "{refused}");
}
