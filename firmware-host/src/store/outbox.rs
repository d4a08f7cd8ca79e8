use jiff::Timestamp;
use rusqlite::types::FromSql;
use rusqlite::{Row, params};
use serde::{Deserialize, Serialize};

use super::error::{Doing, StoreError};
use super::read::Reader;
use super::write::Store;

/// Tables of plants that are on their way.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// Where the table of plants goes.
    pub plants_key: String,
    /// Its bytes.
    pub plants: Vec<u8>,
    /// Where the table of their organs goes.
    pub organs_key: String,
    /// Its bytes.
    pub organs: Vec<u8>,
}

/// What still waits to be sent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outbox {
    /// Plants that wait.
    pub waiting: u64,
    /// Plants that have left.
    pub sent: u64,
    /// When the last one left, RFC 3339 UTC.
    pub last_sent: Option<String>,
    /// The oldest of those that wait, each with its reason.
    pub plants: Vec<Waiting>,
}

/// A plant that waits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Waiting {
    /// Its id.
    pub id: String,
    /// How often it was tried.
    pub attempts: u32,
    /// When it was tried last, RFC 3339 UTC.
    pub last_try: Option<String>,
    /// Why it is still here, `None` before the first try.
    pub reason: Option<String>,
}

impl Store {
    /// Keeps the tables of these plants until they have arrived; the batch's number.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when one of the plants is in a batch already or not in the outbox; nothing is written.
    pub fn save_batch(&self, plants: &[i64], batch: &Batch) -> Result<i64, StoreError> {
        self.transaction("saving a batch", |t| {
            let values = params![batch.plants_key, batch.plants, batch.organs_key, batch.organs];
            t.execute("INSERT INTO batches (plants_key, plants, organs_key, organs) VALUES (?1, ?2, ?3, ?4)", values)
                .doing("saving a batch")?;
            let seq = t.last_insert_rowid();
            let mut packed = 0;
            for plant in plants {
                let sql = "UPDATE outbox SET batch = ?1 WHERE plant = ?2 AND batch IS NULL";
                packed += t.execute(sql, [seq, *plant]).doing("packing a plant")?;
            }
            if packed == plants.len() {
                Ok(seq)
            } else {
                Err(StoreError::Conflict { what: "batch", id: batch.plants_key.clone() })
            }
        })
    }

    /// Notes that an object was read back from a destination; one of a batch is forgotten with the batch.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when it cannot be written.
    pub fn save_upload(
        &self,
        destination: &str,
        key: &str,
        batch: Option<i64>,
        time: Timestamp,
    ) -> Result<(), StoreError> {
        let sql = "INSERT OR IGNORE INTO uploads (destination, key, batch, time) VALUES (?1, ?2, ?3, ?4)";
        self.lock().execute(sql, params![destination, key, batch, time.to_string()]).doing("saving an upload")?;
        Ok(())
    }

    /// Notes why the plants of a batch are still here after a try.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when it cannot be written.
    pub fn note_try(&self, batch: i64, time: Timestamp, reason: &str) -> Result<(), StoreError> {
        let sql = "UPDATE outbox SET attempts = attempts + 1, last_try = ?2, reason = ?3 WHERE batch = ?1";
        self.lock().execute(sql, params![batch, time.to_string(), reason]).doing("noting a try")?;
        Ok(())
    }

    /// Notes why nothing is tried at all.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when it cannot be written.
    pub fn note_waiting(&self, reason: &str) -> Result<(), StoreError> {
        let sql = "UPDATE outbox SET reason = ?1 WHERE reason IS NOT ?1";
        self.lock().execute(sql, [reason]).doing("noting why the sync waits")?;
        Ok(())
    }

    /// Takes the plants of a batch out of the outbox: both tables were read back. How many.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when it cannot be written.
    pub fn retire(&self, batch: i64, destination: &str, time: Timestamp) -> Result<usize, StoreError> {
        self.transaction("retiring a batch", |t| {
            let sql = "INSERT INTO sent (plant, destination, object, time)
                SELECT o.plant, ?2, b.plants_key, ?3 FROM outbox o JOIN batches b ON b.seq = o.batch WHERE b.seq = ?1";
            let sent = t.execute(sql, params![batch, destination, time.to_string()]).doing("saving what was sent")?;
            t.execute("DELETE FROM outbox WHERE batch = ?1", [batch]).doing("clearing the outbox")?;
            t.execute("DELETE FROM batches WHERE seq = ?1", [batch]).doing("dropping a batch")?;
            Ok(sent)
        })
    }
}

impl Reader {
    /// What waits, with the `limit` oldest plants by name, and what has left.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn outbox(&self, limit: u32) -> Result<Outbox, StoreError> {
        let sql = "SELECT (SELECT count(*) FROM outbox), (SELECT count(*) FROM sent), (SELECT max(time) FROM sent)";
        let counts = self.connection.query_row(sql, [], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)));
        let (waiting, sent, last_sent) = counts.doing("counting the outbox")?;
        let sql = "SELECT p.id, o.attempts, o.last_try, o.reason FROM outbox o JOIN plants p ON p.seq = o.plant
            ORDER BY o.seq LIMIT ?1";
        let row = |row: &Row<'_>| {
            Ok(Waiting { id: row.get(0)?, attempts: row.get(1)?, last_try: row.get(2)?, reason: row.get(3)? })
        };
        let mut statement = self.connection.prepare_cached(sql).doing("listing the outbox")?;
        let rows = statement.query_map([limit], row).doing("listing the outbox")?;
        Ok(Outbox { waiting, sent, last_sent, plants: rows.collect::<Result<_, _>>().doing("listing the outbox")? })
    }

    /// The oldest plants that are in no batch, at most `limit`.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn unpacked(&self, limit: usize) -> Result<Vec<i64>, StoreError> {
        self.column("SELECT plant FROM outbox WHERE batch IS NULL ORDER BY seq LIMIT ?1", limit as i64)
    }

    /// The batches that are on their way and how often each was tried, those tried least first.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn batches(&self) -> Result<Vec<(i64, u32)>, StoreError> {
        let sql = "SELECT batch, max(attempts) AS tries FROM outbox WHERE batch IS NOT NULL
            GROUP BY batch ORDER BY tries, batch";
        let mut statement = self.connection.prepare_cached(sql).doing("listing batches")?;
        let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?))).doing("listing batches")?;
        rows.collect::<Result<_, _>>().doing("listing batches")
    }

    /// The ids of a batch's plants.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn batch_plants(&self, batch: i64) -> Result<Vec<String>, StoreError> {
        let sql = "SELECT p.id FROM outbox o JOIN plants p ON p.seq = o.plant WHERE o.batch = ?1 ORDER BY p.seq";
        self.column(sql, batch)
    }

    fn column<T: FromSql>(&self, sql: &str, parameter: i64) -> Result<Vec<T>, StoreError> {
        let mut statement = self.connection.prepare_cached(sql).doing("reading the outbox")?;
        let rows = statement.query_map([parameter], |row| row.get(0)).doing("reading the outbox")?;
        rows.collect::<Result<_, _>>().doing("reading the outbox")
    }

    /// The tables of a batch.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read or the batch is not there.
    pub fn batch(&self, batch: i64) -> Result<Batch, StoreError> {
        let sql = "SELECT plants_key, plants, organs_key, organs FROM batches WHERE seq = ?1";
        let row = |row: &Row<'_>| {
            Ok(Batch { plants_key: row.get(0)?, plants: row.get(1)?, organs_key: row.get(2)?, organs: row.get(3)? })
        };
        self.connection.query_row(sql, [batch], row).doing("reading a batch")
    }

    /// The species files that the plants of a batch need.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn batch_species(&self, batch: i64) -> Result<Vec<Vec<u8>>, StoreError> {
        let sql = "SELECT file FROM species WHERE hash IN
            (SELECT p.species FROM outbox o JOIN plants p ON p.seq = o.plant WHERE o.batch = ?1) ORDER BY hash";
        self.column(sql, batch)
    }

    /// True when the object was read back from that destination before.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn uploaded(&self, destination: &str, key: &str) -> Result<bool, StoreError> {
        let sql = "SELECT 1 FROM uploads WHERE destination = ?1 AND key = ?2";
        let mut statement = self.connection.prepare_cached(sql).doing("looking for an upload")?;
        statement.exists([destination, key]).doing("looking for an upload")
    }
}
