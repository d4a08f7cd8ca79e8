//! `demeter eval` on a tiny synthetic truth: figures where there are data, typed errors where there are none.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

use demeter_recon::cloud::PointOrgan;
use demeter_recon::export::cloud_to_ply;
use demeter_recon::model::{Form, OrganKind, Plant, Species};
use demeter_recon::organs::ScaleSource;
use demeter_recon::traits::{PlantTraits, keys};
use demeter_recon::world::{grow, labelled_cloud, seeded};
use serde_json::{Value, json};

fn eval(arguments: &[&str]) -> (Option<i32>, Value) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_demeter")).arg("eval").args(arguments).arg("--json").output().unwrap();
    (output.status.code(), serde_json::from_slice(&output.stdout).unwrap())
}

/// The truth of one of our own plants in the form of tools/helios/grow.py.
fn truth(plant: &Plant, species: &Species, organ_of_point: &[u32]) -> Value {
    let traits = PlantTraits::of(plant, species, ScaleSource::Input).unwrap();
    let mut labels = 0;
    let organs = plant.organs.iter().zip(&traits.organs).enumerate().map(|(id, (organ, own))| {
        let value = |key: &str| own.get(key).map_or(0.0, |quantity| quantity.value);
        let blade = matches!(organ.form, Form::Leaf { .. });
        labels += i32::from(blade);
        let on = |parent: usize| traits.organs[parent].get(keys::STEM_LENGTH).unwrap().value;
        json!({
            "id": id, "parent": organ.parent, "attach": organ.parent.map_or(0.0, |parent| organ.joint.d * on(parent)),
            "kind": match organ.kind() { OrganKind::MainStem => "main_stem", OrganKind::Stem => "stem", OrganKind::Leaf => "blade" },
            "length": value(if blade { keys::LEAF_LENGTH } else { keys::STEM_LENGTH }),
            "points": organ_of_point.iter().filter(|of| **of as usize == id).count(), "visible": 1.0,
            "label": if blade { labels } else { 0 }, "area": value(keys::LEAF_AREA),
            "inclination": value(keys::LEAF_INCLINATION),
        })
    });
    let organs: Vec<Value> = organs.collect();
    json!({
        "species": "maize", "noise_m": 0.0, "missing": 0.0, "height": traits.plant[keys::HEIGHT].value, "organs": organs,
    })
}

fn write_plant(folder: &Path) {
    let species = demeter_recon::species::shipped("maize").unwrap().unwrap();
    let plant = grow(&species, 0.4, &mut seeded(3));
    let mut made = labelled_cloud(&plant, &species, 6_000, 0.0, &mut seeded(4)).unwrap();
    let organ = |organ: &u32| PointOrgan { organ: *organ as i32, kind: plant.organs[*organ as usize].kind() };
    made.cloud.organs = Some(made.organ.iter().map(organ).collect());
    std::fs::write(folder.join("maize_3.ply"), cloud_to_ply(&made.cloud)).unwrap();
    std::fs::write(folder.join("maize_3.json"), truth(&plant, &species, &made.organ).to_string()).unwrap();
}

#[test]
fn a_plant_of_known_truth_is_measured_and_placed() {
    let folder = tempfile::tempdir().unwrap();
    write_plant(folder.path());
    let path = folder.path().to_str().unwrap();
    let (exit, traits) = eval(&["traits", "--truth", path]);
    assert_eq!((exit, &traits["table"]), (Some(0), &json!("traits")));
    let row = |key: &str| {
        let rows = traits["rows"].as_array().unwrap();
        rows.iter()
            .find(|row| row["trait"] == key && row["species"] == "all")
            .unwrap_or_else(|| panic!("{traits}"))
            .clone()
    };
    let error = |key: &str| row(key)["RMSE"].as_f64().unwrap();
    // A fit to clean points of our own kind of plant; bounds ten times what it reaches, and far below the values.
    assert!(error("height") < 50.0, "{traits}");
    assert!(row("leaf_area")["MAPE %"].as_f64().unwrap() < 30.0, "{traits}");
    assert!(error("leaf_inclination") < 15.0 && error("leaf_length") < 50.0, "{traits}");
    assert!(row("internode_length")["n"].as_u64().unwrap() > 1, "{traits}");
    let (exit, topology) = eval(&["topology", "--truth", path]);
    assert_eq!(exit, Some(0));
    assert!(topology["rows"][0]["right parent"].as_f64().unwrap() > 0.9, "{topology}");
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    let (exit, fit) = eval(&["fit", "--clouds", path, "--pictures", pictures.to_str().unwrap()]);
    assert_eq!(exit, Some(0));
    let labelled =
        fit["rows"].as_array().unwrap().iter().find(|row| row["method"] == "Demeter, labels").unwrap().clone();
    assert!(labelled["CD median"].as_f64().unwrap() < 0.02 && labelled["bytes"].as_f64().unwrap() > 50.0, "{fit}");
    let picture = std::fs::read(pictures.join("maize_3.png")).unwrap();
    // A PNG's header: width and height, big endian, from byte 16.
    assert_eq!(picture[16..24], [0, 0, 5, 120, 0, 0, 2, 188]);
}

#[test]
fn missing_and_broken_data_are_typed_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    for arguments in [["traits", "--truth", "nowhere"], ["topology", "--truth", path], ["leaf", "--clouds", "nowhere"]]
    {
        let (exit, answer) = eval(&arguments);
        assert_eq!((exit, &answer["error"]["kind"]), (Some(2), &json!("data")), "{arguments:?}: {answer}");
    }
    let orphan = json!({
        "species": "maize", "noise_m": 0.0, "missing": 0.0, "height": 1.0,
        "organs": [{"id": 0, "kind": "main_stem", "parent": 7, "attach": 0.0, "length": 1.0, "points": 1, "visible": 1.0}],
    });
    std::fs::write(folder.path().join("x.json"), orphan.to_string()).unwrap();
    let (exit, answer) = eval(&["traits", "--truth", path]);
    assert_eq!((exit, &answer["error"]["kind"]), (Some(2), &json!("truth")), "{answer}");
}
