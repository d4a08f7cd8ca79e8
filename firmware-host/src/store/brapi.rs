use jiff::Timestamp;
use rusqlite::{Row, params};

use super::error::{Doing, StoreError};
use super::outbox::{Outbox, Waiting};
use super::read::Reader;
use super::write::Store;

impl Store {
    /// Notes that a plant was read back from a BrAPI server, under that id.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when it cannot be written.
    pub fn save_unit(&self, plant: i64, destination: &str, unit: &str, time: Timestamp) -> Result<(), StoreError> {
        let sql = "INSERT INTO brapi (plant, destination, unit, sent) VALUES (?1, ?2, ?3, ?4)
            ON CONFLICT DO UPDATE SET unit = excluded.unit, sent = excluded.sent, reason = NULL";
        self.lock().execute(sql, params![plant, destination, unit, time.to_string()]).doing("saving a unit")?;
        Ok(())
    }

    /// Notes why a plant is not at a BrAPI server after a try.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when it cannot be written.
    pub fn note_unit(&self, plant: i64, destination: &str, time: Timestamp, reason: &str) -> Result<(), StoreError> {
        let sql = "INSERT INTO brapi (plant, destination, attempts, last_try, reason) VALUES (?1, ?2, 1, ?3, ?4)
            ON CONFLICT DO UPDATE SET attempts = attempts + 1, last_try = excluded.last_try, reason = excluded.reason";
        self.lock().execute(sql, params![plant, destination, time.to_string(), reason]).doing("noting a try")?;
        Ok(())
    }
}

/// Plants and what is known of them at the destination `?1`.
const UNITS: &str = "FROM plants p LEFT JOIN brapi b ON b.plant = p.seq AND b.destination = ?1";

impl Reader {
    /// The plants that are not at a BrAPI server, those tried least first.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn without_unit(&self, destination: &str) -> Result<Vec<i64>, StoreError> {
        let sql = format!("SELECT p.seq {UNITS} WHERE b.sent IS NULL ORDER BY coalesce(b.attempts, 0), p.seq");
        let mut statement = self.connection.prepare_cached(&sql).doing("listing plants without a unit")?;
        let rows = statement.query_map([destination], |row| row.get(0)).doing("listing plants without a unit")?;
        rows.collect::<Result<_, _>>().doing("listing plants without a unit")
    }

    /// Which plant of its session it is, from 1, in the order they were seen.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn number_in_session(&self, plant: i64) -> Result<u64, StoreError> {
        let sql = "SELECT count(*) FROM plants p JOIN plants o ON o.session = p.session AND o.seq <= p.seq
            WHERE p.seq = ?1";
        self.connection.query_row(sql, [plant], |row| row.get(0)).doing("counting a session's plants")
    }

    /// What waits for a BrAPI server, with the `limit` oldest plants by name, and what is there.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn units(&self, destination: &str, limit: u32) -> Result<Outbox, StoreError> {
        let sql = format!("SELECT count(*) - count(b.sent), count(b.sent), max(b.sent) {UNITS}");
        let counts = self.connection.query_row(&sql, [destination], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)));
        let (waiting, sent, last_sent) = counts.doing("counting units")?;
        let sql = format!(
            "SELECT p.id, coalesce(b.attempts, 0), b.last_try, b.reason {UNITS} WHERE b.sent IS NULL
             ORDER BY p.seq LIMIT ?2"
        );
        let row = |row: &Row<'_>| {
            Ok(Waiting { id: row.get(0)?, attempts: row.get(1)?, last_try: row.get(2)?, reason: row.get(3)? })
        };
        let mut statement = self.connection.prepare_cached(&sql).doing("listing plants without a unit")?;
        let rows = statement.query_map(params![destination, limit], row).doing("listing plants without a unit")?;
        let plants = rows.collect::<Result<_, _>>().doing("listing plants without a unit")?;
        Ok(Outbox { waiting, sent, last_sent, plants })
    }
}
