//! Plants and their organs as Parquet: what leaves the box, and `demeter plants export --format parquet`.
//!
//! The same plants give the same bytes. Columns carry their unit and ontology ids (spec/standards.md) as metadata, the
//! table of plants a WKB point as GeoParquet 1.1 wants it. docs/sync.md lists every column.

mod columns;
mod merge;
mod traits;

use std::collections::HashMap;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::json;

use crate::report::{OrganReport, word};
use crate::store::WholePlant;
use columns::Columns;
pub use merge::{Merger, Table};
pub use traits::{TRAITS, TraitColumn};

/// A table of plants, one row each.
///
/// # Errors
/// [`ParquetError`] when it cannot be written.
pub fn plants(plants: &[WholePlant]) -> Result<Vec<u8>, ParquetError> {
    let mut columns = Columns::default();
    columns.text("id", plants, |p| Some(&p.row.id));
    columns.text("rig", plants, |p| Some(&p.rig));
    columns.text("session", plants, |p| Some(&p.row.session));
    columns.text("species", plants, |p| Some(&p.row.species));
    columns.text("species_hash", plants, |p| p.report.species_hash.as_deref());
    columns.time("time", plants, |p| p.row.time.parse().ok());
    columns.truth("time_trusted", plants, |p| p.row.time_trusted);
    let scales: Vec<_> = plants.iter().map(|p| word(&p.row.scale_source)).collect();
    columns.text("scale_source", &scales, |scale| Some(scale));
    for (i, name) in ["x", "y", "z"].into_iter().enumerate() {
        columns.number(name, &[("unit", "m")], plants, |p| p.row.position.map(|position| position[i]));
    }
    columns.bytes("geometry", plants, |p| p.row.geographic.map(point));
    columns.number("cd", &[("unit", "1")], plants, |p| p.row.cd);
    columns.traits(plants, |column| column.plant, |p| &p.report.traits);
    columns.bytes("record", plants, |p| Some(&p.record));
    let pictures: Vec<_> = plants.iter().map(|p| p.thumbnail.as_deref().map(hash)).collect();
    columns.text("thumbnail", &pictures, |hash| hash.as_deref());
    columns.text("provenance", plants, |p| Some(&p.provenance));
    columns.text("frames", plants, |p| Some(&p.frames));
    columns.text("cameras", plants, |p| Some(&p.cameras));
    let warnings: Vec<_> = plants.iter().map(|p| json!(p.report.warnings).to_string()).collect();
    columns.text("warnings", &warnings, |json| Some(json));
    // GDAL and DuckDB look for it in the file, pyarrow and GeoPandas in Arrow's schema.
    let geo = geo();
    let of_schema = geo.value.iter().map(|value| (geo.key.clone(), value.clone())).collect();
    write(columns.finish(of_schema)?, Some(geo))
}

/// A table of the organs of plants, one row each, parents before children.
///
/// # Errors
/// [`ParquetError`] when it cannot be written.
pub fn organs(plants: &[WholePlant]) -> Result<Vec<u8>, ParquetError> {
    let organs = plants.iter().flat_map(|p| p.report.organs.iter().map(move |organ| (p, organ)));
    let organs: Vec<(&WholePlant, &OrganReport)> = organs.collect();
    let mut columns = Columns::default();
    columns.text("plant", &organs, |(p, _)| Some(&p.row.id));
    columns.text("rig", &organs, |(p, _)| Some(&p.rig));
    columns.text("session", &organs, |(p, _)| Some(&p.row.session));
    columns.whole("id", &organs, |(_, organ)| Some(organ.id as i64));
    let kinds: Vec<_> = organs.iter().map(|(_, organ)| word(&organ.kind)).collect();
    columns.text("kind", &kinds, |kind| Some(kind));
    columns.whole("parent", &organs, |(_, organ)| organ.parent.map(|parent| parent as i64));
    columns.whole("leaf", &organs, |(_, organ)| organ.leaf.map(i64::from));
    columns.whole("points", &organs, |(_, organ)| organ.points.map(|points| points as i64));
    columns.number("residual", &[("unit", "m")], &organs, |(_, organ)| organ.residual);
    columns.number("visible_fraction", &[("unit", "1")], &organs, |(_, organ)| organ.visible_fraction);
    columns.traits(&organs, |column| column.organ, |(_, organ)| &organ.traits);
    write(columns.finish(HashMap::new())?, None)
}

/// BLAKE3 in hexadecimal, as keys and columns name contents.
#[must_use]
pub fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// A point as little-endian WKB; longitude first, as GeoParquet's default reference system (OGC:CRS84) has it.
fn point([latitude, longitude]: [f64; 2]) -> Vec<u8> {
    [&[1][..], &1u32.to_le_bytes(), &longitude.to_le_bytes(), &latitude.to_le_bytes()].concat()
}

/// GeoParquet's metadata of the file.
fn geo() -> KeyValue {
    let column = json!({"encoding": "WKB", "geometry_types": ["Point"]});
    let geo = json!({"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}});
    KeyValue::new("geo".to_owned(), geo.to_string())
}

fn write(batch: RecordBatch, geo: Option<KeyValue>) -> Result<Vec<u8>, ParquetError> {
    let mut writer = writer(batch.schema(), geo.into_iter().collect())?;
    writer.write(&batch)?;
    writer.into_inner()
}

fn writer(schema: SchemaRef, about: Vec<KeyValue>) -> Result<ArrowWriter<Vec<u8>>, ParquetError> {
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(concat!("demeter ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(about).filter(|about| !about.is_empty()))
        .build();
    ArrowWriter::try_new(Vec::new(), schema, Some(properties))
}
