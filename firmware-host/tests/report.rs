//! What the commands print obeys the frozen contract, and the table shows the same plants.
#![allow(clippy::unwrap_used)]

use demeter::error::{CommandError, Exit};
use demeter::report::{Camera, Document, ErrorDocument, Kind, OrganReport, PlantReport, table};
use demeter_frame::{Intrinsics, Pose};
use demeter_recon::organs::ScaleSource;
use demeter_recon::traits::{Quantity, Unit};

fn plant() -> PlantReport {
    let quantity = |value, unit, sigma| Quantity { value, unit, sigma };
    PlantReport {
        id: Some("row-1-0001".into()),
        species: "soybean".into(),
        species_hash: Some("00ff".into()),
        organs: vec![OrganReport {
            id: 0,
            kind: Kind::MainStem,
            parent: None,
            leaf: None,
            points: Some(812),
            residual: Some(0.002),
            visible_fraction: None,
            traits: [("stem_length".into(), quantity(0.4, Unit::Metre, None))].into(),
        }],
        traits: [
            ("height".into(), quantity(0.412, Unit::Metre, Some(0.01))),
            ("leaf_count".into(), quantity(5.0, Unit::One, None)),
            ("blade_count".into(), quantity(13.0, Unit::One, None)),
            ("leaf_area".into(), quantity(0.0345, Unit::SquareMetre, None)),
        ]
        .into(),
        cd: Some(0.0312),
        bytes: 96,
        scale_source: ScaleSource::GroundPlane,
        record: None,
        camera: Some(Camera { intrinsics: Intrinsics::from_hfov(640, 480, 1.0), camera_from_plant: Pose::IDENTITY }),
        warnings: vec!["one blade was hidden".into()],
        ms: Some(41.6),
    }
}

#[test]
fn documents_obey_the_contract_and_survive_a_round_trip() {
    let schema = include_str!("../../docs/plant.schema.json");
    let schema = jsonschema::validator_for(&serde_json::from_str(schema).unwrap()).unwrap();
    let bare = PlantReport { id: None, species_hash: None, cd: None, camera: None, organs: vec![], ..plant() };
    let document = Document { plants: vec![plant(), bare], warnings: vec!["dark".into()], seconds: Some(0.5) };
    let json = serde_json::to_value(&document).unwrap();
    schema.validate(&json).unwrap();
    assert_eq!(serde_json::to_value(serde_json::from_value::<Document>(json.clone()).unwrap()).unwrap(), json);
    let unit = serde_json::to_value(Unit::PerMetre).unwrap();
    assert_eq!(unit, "1/m");

    let error = CommandError::usage("species", "no such species").with("soybean or maize", "oak");
    assert_eq!(error.exit, Exit::BadUse);
    schema.validate(&serde_json::to_value(ErrorDocument::from(&error)).unwrap()).unwrap();
}

#[test]
fn the_table_lines_up_and_says_what_is_unknown() {
    let unknown = PlantReport { traits: Default::default(), cd: None, ms: None, ..plant() };
    let text = table(&[plant(), unknown], false);
    let expected = "\
plant       species  leaves  blades  height cm  leaf area cm2      CD  bytes  ms
row-1-0001  soybean       5      13       41.2          345.0  0.0312     96  42
row-1-0001  soybean       -       -          -              -       -     96   -
";
    assert_eq!(text, expected);
    assert!(table(&[plant()], true).starts_with("\x1b[1mplant"));
}
