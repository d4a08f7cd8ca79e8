use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use bytes::Bytes;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;

use super::writer;

/// A Parquet file's content.
#[derive(Debug)]
pub struct Table {
    schema: SchemaRef,
    /// What the file says of itself besides its schema: GeoParquet's metadata.
    about: Vec<KeyValue>,
    batches: Vec<RecordBatch>,
}

impl Table {
    /// Reads a whole file.
    ///
    /// # Errors
    /// [`ParquetError`] when it is none.
    pub fn read(file: Vec<u8>) -> Result<Self, ParquetError> {
        let reader = ParquetRecordBatchReaderBuilder::try_new(Bytes::from(file))?;
        let about = reader.metadata().file_metadata().key_value_metadata().into_iter().flatten();
        // The writer adds Arrow's schema itself.
        let about = about.filter(|pair| pair.key != parquet::arrow::ARROW_SCHEMA_META_KEY).cloned().collect();
        let schema = reader.schema().clone();
        Ok(Self { schema, about, batches: reader.build()?.collect::<Result<_, _>>()? })
    }
}

/// Tables of one schema on their way into one file, row after row.
#[derive(Debug)]
pub struct Merger {
    schema: SchemaRef,
    about: Vec<KeyValue>,
    writer: ArrowWriter<Vec<u8>>,
    rows: u64,
}

impl Merger {
    /// A file that begins with this table.
    ///
    /// # Errors
    /// [`ParquetError`] when it cannot be written.
    pub fn new(table: &Table) -> Result<Self, ParquetError> {
        let (schema, about) = (table.schema.clone(), table.about.clone());
        let writer = writer(schema.clone(), about.clone())?;
        let mut merger = Self { schema, about, writer, rows: 0 };
        merger.add(table)?;
        Ok(merger)
    }

    /// Whether the table has the same columns, of which the same is said.
    #[must_use]
    pub fn takes(&self, table: &Table) -> bool {
        (&self.schema, &self.about) == (&table.schema, &table.about)
    }

    /// Appends a table that it [takes](Self::takes).
    ///
    /// # Errors
    /// [`ParquetError`] when it cannot be written.
    pub fn add(&mut self, table: &Table) -> Result<(), ParquetError> {
        for batch in &table.batches {
            self.writer.write(batch)?;
            self.rows += batch.num_rows() as u64;
        }
        Ok(())
    }

    /// The file and its rows.
    ///
    /// # Errors
    /// [`ParquetError`] when it cannot be written.
    pub fn finish(self) -> Result<(Vec<u8>, u64), ParquetError> {
        Ok((self.writer.into_inner()?, self.rows))
    }
}
