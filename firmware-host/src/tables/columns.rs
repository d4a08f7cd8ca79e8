use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BinaryArray, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray, TimestampMicrosecondArray,
};
use arrow_schema::{Field, Schema};
use demeter_recon::traits::Traits;
use parquet::errors::ParquetError;

use super::traits::{TRAITS, TraitColumn};

/// The columns of a table, in the order they are added.
#[derive(Default)]
pub(super) struct Columns {
    fields: Vec<Field>,
    arrays: Vec<ArrayRef>,
}

impl Columns {
    fn add(&mut self, name: &str, metadata: &[(&str, &str)], array: ArrayRef) {
        let metadata = metadata.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
        let metadata: HashMap<_, _> = metadata.collect();
        self.fields.push(Field::new(name, array.data_type().clone(), true).with_metadata(metadata));
        self.arrays.push(array);
    }

    pub(super) fn text<'a, R>(&mut self, name: &str, rows: &'a [R], value: impl Fn(&'a R) -> Option<&'a str>) {
        self.add(name, &[], Arc::new(rows.iter().map(value).collect::<StringArray>()));
    }

    pub(super) fn bytes<'a, R, B: AsRef<[u8]>>(
        &mut self,
        name: &str,
        rows: &'a [R],
        value: impl Fn(&'a R) -> Option<B>,
    ) {
        self.add(name, &[], Arc::new(rows.iter().map(value).collect::<BinaryArray>()));
    }

    pub(super) fn truth<R>(&mut self, name: &str, rows: &[R], value: impl Fn(&R) -> bool) {
        self.add(name, &[], Arc::new(rows.iter().map(|row| Some(value(row))).collect::<BooleanArray>()));
    }

    pub(super) fn whole<R>(&mut self, name: &str, rows: &[R], value: impl Fn(&R) -> Option<i64>) {
        self.add(name, &[], Arc::new(rows.iter().map(value).collect::<Int64Array>()));
    }

    pub(super) fn number<'a, R>(
        &mut self,
        name: &str,
        metadata: &[(&str, &str)],
        rows: &'a [R],
        value: impl Fn(&'a R) -> Option<f64>,
    ) {
        self.add(name, metadata, Arc::new(rows.iter().map(value).collect::<Float64Array>()));
    }

    pub(super) fn time<R>(&mut self, name: &str, rows: &[R], value: impl Fn(&R) -> Option<jiff::Timestamp>) {
        let micros = rows.iter().map(|row| value(row).map(jiff::Timestamp::as_microsecond));
        self.add(name, &[], Arc::new(micros.collect::<TimestampMicrosecondArray>().with_timezone("UTC")));
    }

    /// Two columns a trait: its value with unit and ontology ids, and its standard uncertainty.
    pub(super) fn traits<'a, R>(
        &mut self,
        rows: &'a [R],
        wanted: impl Fn(&TraitColumn) -> bool,
        traits: impl Fn(&'a R) -> &'a Traits,
    ) {
        for column in TRAITS.iter().filter(|column| wanted(column)) {
            let unit = column.unit.to_string();
            let metadata = [("unit", unit.as_str()), ("ontology", column.ontology)];
            let known = if column.ontology.is_empty() { &metadata[..1] } else { &metadata };
            self.number(column.key, known, rows, |row| traits(row).get(column.key).map(|quantity| quantity.value));
            let sigma = format!("{}_sigma", column.key);
            self.number(&sigma, &metadata[..1], rows, |row| traits(row).get(column.key)?.sigma);
        }
    }

    /// The table, with what is said of it as a whole.
    pub(super) fn finish(self, metadata: HashMap<String, String>) -> Result<RecordBatch, ParquetError> {
        let schema = Schema::new(self.fields).with_metadata(metadata);
        Ok(RecordBatch::try_new(Arc::new(schema), self.arrays)?)
    }
}
