//! `demeter plants` and `demeter doctor` over a store on disk.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;
use std::process::{Command, Output};

use common::{Bench, stored};

fn demeter(bench: &Bench, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_demeter"));
    command.args(arguments).arg("--db").arg(&bench.path).current_dir(bench.folder.path()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn lists_and_shows_plants_as_table_and_as_the_contracts_json() {
    let bench = stored(2);
    let table = text(&demeter(&bench, &["plants", "list"]).stdout);
    assert_eq!(table.lines().count(), 3, "{table}");
    assert!(table.contains("row-0001  soybean       1       1        1.0"), "{table}");
    assert!(!table.contains('\x1b'), "no escape codes off a terminal");

    let schema = serde_json::from_str(include_str!("../../docs/plant.schema.json")).unwrap();
    let schema = jsonschema::validator_for(&schema).unwrap();
    for (arguments, plants) in [(&["plants", "list", "--json"][..], 2), (&["plants", "show", "row-0002", "--json"], 1)]
    {
        let answer = serde_json::from_slice(&demeter(&bench, arguments).stdout).unwrap();
        schema.validate(&answer).unwrap();
        assert_eq!(answer["plants"].as_array().unwrap().len(), plants);
    }
    let shown = text(&demeter(&bench, &["plants", "show", "first"]).stdout);
    assert!(shown.contains("row-0001") && shown.contains("height") && shown.contains("leaf_area"), "{shown}");
}

#[test]
fn writes_the_picture_tables_and_meshes() {
    let bench = stored(2);
    let file = |name: &str| bench.folder.path().join(name);
    assert!(demeter(&bench, &["plants", "show", "first", "--picture", "p.png"]).status.success());
    assert_eq!(Some(std::fs::read(file("p.png")).unwrap()), bench.plant(1).thumbnail);

    let csv = text(&demeter(&bench, &["plants", "export", "--format", "csv"]).stdout);
    let lines: Vec<_> = csv.lines().map(|line| line.split(',').collect::<Vec<_>>()).collect();
    assert_eq!(lines.len(), 3);
    assert!(lines.iter().all(|cells| cells.len() == lines[0].len()), "{csv}");
    let column = lines[0].iter().position(|name| *name == "height_m").unwrap();
    assert_eq!((lines[1][column], lines[2][column]), ("0.01", "0.02"));

    assert!(demeter(&bench, &["plants", "export", "--format", "geojson", "-o", "p.json"]).status.success());
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(file("p.json")).unwrap()).unwrap();
    assert_eq!((&json["type"], &json["features"][1]["id"]), (&"FeatureCollection".into(), &"row-0002".into()));

    for (format, magic) in [("glb", "glTF"), ("ply", "ply\n"), ("obj", "# me")] {
        let output = demeter(&bench, &["plants", "export", "row-0002", "--format", format, "-o", format]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let folder: Vec<_> = std::fs::read_dir(file(format)).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert_eq!(folder, [file(&format!("{format}/row-0002.{format}"))]);
        assert_eq!(std::fs::read(&folder[0]).unwrap()[..4], *magic.as_bytes());
    }
}

#[test]
fn what_is_not_there_is_named_and_ends_with_the_contracts_code() {
    let bench = stored(1);
    let cases: [(&[&str], i32, &str); 4] = [
        (&["plants", "show", "row-0009"], 2, "row-0009"),
        (&["plants", "export", "row-0009", "--format", "csv"], 2, "row-0009"),
        (&["plants", "export", "--format", "xlsx"], 2, "xlsx"),
        (&["plants", "export", "--format", "csv", "-o", "/no/such/folder/x.csv"], 1, "/no/such/folder/x.csv"),
    ];
    for (arguments, code, part) in cases {
        let output = demeter(&bench, arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        assert!(text(&output.stderr).contains(part), "{}", text(&output.stderr));
    }
    let none = Command::new(env!("CARGO_BIN_EXE_demeter"))
        .args(["plants", "list", "--json", "--db", "missing.sqlite"])
        .current_dir(bench.folder.path())
        .output()
        .unwrap();
    assert_eq!(none.status.code(), Some(2));
    assert_eq!(serde_json::from_slice::<serde_json::Value>(&none.stdout).unwrap()["error"]["kind"], "no_store");
    assert!(!bench.folder.path().join("missing.sqlite").exists());

    rusqlite::Connection::open(&bench.path).unwrap().pragma_update(None, "user_version", 99).unwrap();
    for arguments in [&["plants", "list"][..], &["run"]] {
        assert_eq!(demeter(&bench, arguments).status.code(), Some(78), "{arguments:?}");
    }
}

#[test]
fn the_doctor_names_each_check_and_how_to_mend_what_fails() {
    let bench = stored(1);
    let check = |db: &Path| {
        let mut doctor = Command::new(env!("CARGO_BIN_EXE_demeter"));
        doctor.args(["doctor", "--json", "--db"]).arg(db).env("DEMETER_ONNXRUNTIME", "/no/such/library.so");
        let output = doctor.output().unwrap();
        // Without ONNX Runtime it cannot be well.
        assert_eq!(output.status.code(), Some(1));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()["checks"].as_array().unwrap().clone()
    };
    let checks = check(&bench.path);
    let of = |name: &str| checks.iter().find(|check| check["name"] == name).unwrap();
    for name in ["configuration", "store", "species"] {
        assert_eq!(of(name)["ok"], true, "{name}: {}", of(name));
    }
    assert!(of("store")["found"].as_str().unwrap().contains("1 plants"));
    assert!(of("disk")["found"].as_str().unwrap().contains("GB free"));
    let onnx = of("ONNX Runtime");
    assert_eq!(onnx["ok"], false);
    assert!(onnx["found"].as_str().unwrap().contains("/no/such/library.so"), "{onnx}");
    assert!(onnx["mend"].as_str().unwrap().contains("tools/fetch-onnxruntime.sh"), "{onnx}");

    std::fs::write(bench.folder.path().join("notes.txt"), "words".repeat(1000)).unwrap();
    let checks = check(&bench.folder.path().join("notes.txt"));
    assert!(checks.iter().any(|check| check["name"] == "store" && check["ok"] == false));
}
