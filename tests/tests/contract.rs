//! The frozen contract of the JSON output: our copy is the given one, and it tells good documents from bad ones.
#![allow(clippy::unwrap_used)]

use serde_json::{Value, json};

#[test]
fn our_copy_is_the_given_schema() {
    let Some(given) = demeter_tests::shared("our_copy_is_the_given_schema", "spec/plant.schema.json") else { return };
    let ours = demeter_tests::root().join("docs/plant.schema.json");
    assert_eq!(std::fs::read(ours).unwrap(), std::fs::read(given).unwrap(), "the contract is frozen");
}

/// One soybean with a main stem and a blade, using every part of the contract that is not an error.
fn document() -> Value {
    let height = json!({"value": 0.41, "unit": "m", "sigma": null});
    json!({
        "plants": [{
            "id": "row-1/3", "species": "soybean", "species_hash": "00ff",
            "organs": [
                {"id": 0, "kind": "main_stem", "parent": null, "traits": {"stem_length": height}},
                {"id": 1, "kind": "leaf", "parent": 0, "leaf": 0, "points": 812, "residual": 0.002, "visible_fraction": 0.7},
            ],
            "traits": {"height": height, "leaf_count": {"value": 1, "unit": "1", "sigma": 0.2}},
            "cd": 0.031, "bytes": 96, "scale_source": "ground_plane", "record": "plant.dmtr",
            "camera": {
                "width": 640, "height": 480, "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0,
                "camera_from_plant": {"q": [0, 0, 0, 1], "t": [0, 0, 1]},
            },
            "warnings": [],
        }],
        "warnings": ["one frame was blurred"], "seconds": 0.5,
    })
}

/// The document with the value at `pointer` replaced, or removed where `value` is null.
fn spoiled(pointer: &str, value: Value) -> Value {
    let mut document = document();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = document.pointer_mut(parent).unwrap().as_object_mut().unwrap();
    match value {
        Value::Null => drop(parent.remove(key).unwrap()),
        value => drop(parent.insert(key.to_owned(), value)),
    }
    document
}

#[test]
fn accepts_plants_and_a_typed_error() {
    let schema = demeter_tests::schema();
    schema.validate(&document()).unwrap();
    schema
        .validate(&json!({"error": {"kind": "no_plant", "message": "nothing green", "expected": 1, "found": 0}}))
        .unwrap();
}

#[test]
fn rejects_what_breaks_the_contract() {
    let schema = demeter_tests::schema();
    let bad = [
        ("bytes missing", spoiled("/plants/0/bytes", Value::Null)),
        ("an unknown trait", spoiled("/plants/0/traits/colour", json!({"value": 1, "unit": "1", "sigma": null}))),
        (
            "a unit that is not SI",
            spoiled("/plants/0/traits/height", json!({"value": 41, "unit": "cm", "sigma": null})),
        ),
        ("a trait without its uncertainty", spoiled("/plants/0/traits/height", json!({"value": 0.4, "unit": "m"}))),
        ("an unknown kind of organ", spoiled("/plants/0/organs", json!([{"id": 0, "kind": "root", "parent": null}]))),
        ("a quaternion of three numbers", spoiled("/plants/0/camera/camera_from_plant/q", json!([0, 0, 1]))),
        ("an unknown source of scale", spoiled("/plants/0/scale_source", json!("guess"))),
        ("an error without a kind", json!({"error": {"message": "nothing green"}})),
        ("plants and an error at once", spoiled("/error", json!({"kind": "k", "message": "m"}))),
        ("nothing", json!({})),
    ];
    for (what, document) in bad {
        assert!(!schema.is_valid(&document), "accepted {what}: {document}");
    }
}
