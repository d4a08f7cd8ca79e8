//! The tables that leave the box: their columns say what they mean, and the same plants give the same bytes.
#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeSet;

use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use common::bench;
use common::sync::{rows, texts};
use demeter::tables::{self, TRAITS};
use parquet::file::reader::{FileReader, SerializedFileReader};

#[test]
fn a_plant_is_one_row_with_its_record_units_ontology_and_geometry() {
    let bench = bench();
    bench.fill(1..=3);
    let plants = bench.store.reader().unwrap().whole(&[1, 2, 3]).unwrap();
    let file = tables::plants(&plants).unwrap();
    assert_eq!(file, tables::plants(&plants).unwrap(), "the same plants give the same bytes");
    let table = &rows(&file)[0];
    assert_eq!(texts(table, "id"), ["row-0001", "row-0002", "row-0003"]);
    assert_eq!(texts(table, "rig"), ["rig 1/a", "rig 2/a", "rig-1"]);
    assert_eq!(texts(table, "scale_source"), ["ground_plane"; 3]);
    assert_eq!(texts(table, "frames")[0], r#"[["nadir",1],["nadir",2]]"#);
    assert_eq!(texts(table, "cameras")[0], r#"{"nadir":{"fx":500.0}}"#);
    let records = table.column_by_name("record").unwrap().as_binary::<i32>();
    assert_eq!(records.value(1), bench.plant(2).record);
    let height = table.column_by_name("height").unwrap().as_primitive::<Float64Type>();
    assert_eq!(height.value(2), 0.03);
    let schema = table.schema();
    let field = |name| schema.field_with_name(name).unwrap().metadata().clone();
    assert_eq!(field("height").get("unit").map(String::as_str), Some("m"));
    assert!(field("height").get("ontology").unwrap().contains("CO_336:0000258"));
    assert_eq!(field("height_sigma").get("unit").map(String::as_str), Some("m"));

    // WKB: little-endian point, longitude first; none without a fix.
    let geometry = table.column_by_name("geometry").unwrap().as_binary::<i32>();
    assert!(geometry.is_null(0) && geometry.is_valid(1));
    let expected = [&[1, 1, 0, 0, 0][..], &5.5_f64.to_le_bytes(), &52.00002_f64.to_le_bytes()].concat();
    assert_eq!(geometry.value(1), expected);
    let reader = SerializedFileReader::new(bytes::Bytes::from(file)).unwrap();
    let pairs = reader.metadata().file_metadata().key_value_metadata().unwrap();
    let geo = pairs.iter().find(|pair| pair.key == "geo").unwrap().value.as_deref().unwrap();
    let geo: serde_json::Value = serde_json::from_str(geo).unwrap();
    assert_eq!((&geo["version"], &geo["primary_column"]), (&"1.1.0".into(), &"geometry".into()));
    assert_eq!(geo["columns"]["geometry"]["encoding"], "WKB");
}

#[test]
fn an_organ_is_one_row_and_an_empty_table_is_a_table() {
    let bench = bench();
    bench.fill(1..=2);
    let plants = bench.store.reader().unwrap().whole(&[1, 2]).unwrap();
    let table = &rows(&tables::organs(&plants).unwrap())[0];
    assert_eq!(texts(table, "plant"), ["row-0001", "row-0001", "row-0002", "row-0002"]);
    assert_eq!(texts(table, "kind"), ["main_stem", "leaf", "main_stem", "leaf"]);
    let parent = table.column_by_name("parent").unwrap();
    assert!(parent.is_null(0) && parent.is_valid(1));
    assert!(rows(&tables::plants(&[]).unwrap()).is_empty());
}

#[test]
fn traits_have_the_units_and_ontology_ids_of_the_documentation() {
    let text = include_str!("../../docs/traits.md");
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let lines: Vec<_> = text.lines().filter(|line| line.starts_with("| `")).map(cells).collect();
    assert_eq!(lines.len(), TRAITS.len());
    let ids = |text: &str| -> BTreeSet<String> {
        let words = text.split([' ', ',']).filter(|word| word.starts_with("CO_") || word.starts_with("TO:"));
        words.map(str::to_owned).collect()
    };
    for (line, column) in lines.iter().zip(TRAITS) {
        assert_eq!(line[1], format!("`{}`", column.key));
        assert_eq!(line[3], column.unit.to_string(), "{}", column.key);
        assert_eq!(ids(&line[6]), ids(column.ontology), "{}", column.key);
        assert_eq!(column.plant, line[2].contains("plant"), "{}", column.key);
    }
    let contract: serde_json::Value = serde_json::from_str(include_str!("../../docs/plant.schema.json")).unwrap();
    let keys = contract["$defs"]["traits"]["propertyNames"]["enum"].as_array().unwrap();
    let keys: BTreeSet<_> = keys.iter().map(|key| key.as_str().unwrap()).collect();
    let ours: BTreeSet<_> = TRAITS.iter().map(|column| column.key).collect();
    assert_eq!(keys.difference(&ours).copied().collect::<Vec<_>>(), ["lai"], "a trait without a column");
}
