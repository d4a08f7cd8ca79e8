use std::path::Path;

use demeter_recon::organs::ScaleSource;
use rusqlite::types::{FromSql, FromSqlError, FromSqlResult, ValueRef};
use rusqlite::{Connection, OptionalExtension, Row};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::connection;
use super::error::{Doing, StoreError};
use crate::report::{OrganReport, PlantReport};

/// Reads the store beside its writer.
#[derive(Debug)]
pub struct Reader {
    pub(super) connection: Connection,
}

/// A plant in a list.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlantRow {
    /// Order of arrival.
    pub seq: i64,
    /// Its id.
    pub id: String,
    /// The session it was seen in.
    pub session: String,
    /// Name of its species.
    pub species: String,
    /// When it was seen, RFC 3339 UTC.
    pub time: String,
    /// The clock was synchronised then.
    pub time_trusted: bool,
    /// Where the metric scale comes from.
    pub scale_source: ScaleSource,
    /// The main stem's base in the session's world, metres.
    pub position: Option<[f64; 3]>,
    /// Latitude and longitude, WGS 84 degrees.
    pub geographic: Option<[f64; 2]>,
    /// Metres.
    pub height: Option<f64>,
    /// Leaves, a compound leaf once.
    pub leaf_count: Option<f64>,
    /// Blades, every leaflet.
    pub blade_count: Option<f64>,
    /// Square metres.
    pub leaf_area: Option<f64>,
    /// Chamfer distance as a share of the cloud's diagonal.
    pub cd: Option<f64>,
    /// Size of the compact record.
    pub bytes: usize,
    /// It has a picture.
    pub thumbnail: bool,
}

/// A part of the list, newest first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Page {
    /// The plants.
    pub plants: Vec<PlantRow>,
    /// Where the next page begins, `None` after the last.
    pub next: Option<i64>,
}

/// A compact record as it was saved.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRecord {
    /// The compact record.
    pub record: Vec<u8>,
    /// The species file that decodes it.
    pub species: Vec<u8>,
}

/// What is in the store.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Plants.
    pub plants: u64,
    /// Plants that wait to be sent.
    pub unsent: u64,
    /// Time of the plant that came last.
    pub last_plant: Option<String>,
    /// Every session with its plants.
    pub sessions: Vec<SessionRow>,
}

/// A session in the summary.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SessionRow {
    /// Its id.
    pub id: String,
    /// Its rig.
    pub rig: String,
    /// Its plants.
    pub plants: u64,
}

/// The columns of a [`PlantRow`].
pub(super) const ROW: &str =
    "SELECT p.seq, p.id, p.session, s.name AS species, p.time, p.time_trusted, p.scale_source, p.x, p.y,
    p.z, p.latitude, p.longitude, p.height, p.leaf_count, p.blade_count, p.leaf_area, p.cd,
    length(p.record) AS bytes, p.thumbnail IS NOT NULL AS thumbnail
    FROM plants p JOIN species s ON s.hash = p.species";

impl Reader {
    /// Most plants on one page.
    pub const MAX_PAGE: u32 = 500;

    /// Opens an existing store.
    ///
    /// # Errors
    /// [`StoreError::Missing`] where there is none, else as [`super::Store::open`].
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Ok(Self { connection: connection::reader(path)? })
    }

    /// The settings in force on this connection, by name.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when they cannot be read.
    pub fn pragmas(&self) -> Result<Vec<(&'static str, String)>, StoreError> {
        connection::pragmas(&self.connection)
    }

    /// Up to `limit` plants (at most [`Self::MAX_PAGE`]) that came before `before`, newest first.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn page(&self, before: Option<i64>, limit: u32) -> Result<Page, StoreError> {
        let limit = limit.clamp(1, Self::MAX_PAGE);
        let sql = format!("{ROW} WHERE p.seq < ?1 ORDER BY p.seq DESC LIMIT ?2");
        let mut statement = self.connection.prepare_cached(&sql).doing("listing plants")?;
        let rows = statement.query_map((before.unwrap_or(i64::MAX), limit), plant_row).doing("listing plants")?;
        let plants = rows.collect::<Result<Vec<_>, _>>().doing("listing plants")?;
        let next = plants.last().map(|plant| plant.seq).filter(|_| plants.len() == limit as usize);
        Ok(Page { plants, next })
    }

    /// Every plant, oldest first.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn all(&self) -> Result<Vec<PlantRow>, StoreError> {
        let mut statement = self.connection.prepare(&format!("{ROW} ORDER BY p.seq")).doing("listing plants")?;
        statement.query_map([], plant_row).doing("listing plants")?.collect::<Result<_, _>>().doing("listing plants")
    }

    /// The id of the oldest plant.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn first(&self) -> Result<Option<String>, StoreError> {
        let found = self.connection.query_row("SELECT id FROM plants ORDER BY seq LIMIT 1", [], |row| row.get(0));
        found.optional().doing("looking for the first plant")
    }

    /// A plant with its organs, `None` where the id is unknown.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn plant(&self, id: &str) -> Result<Option<PlantReport>, StoreError> {
        let sql = "SELECT p.seq, p.id, s.name, p.species, p.traits, p.cd, length(p.record), p.scale_source, p.warnings
            FROM plants p JOIN species s ON s.hash = p.species WHERE p.id = ?1";
        let found = self.connection.query_row(sql, [id], |row| {
            let plant = PlantReport {
                id: row.get(1)?,
                species: row.get(2)?,
                species_hash: row.get(3)?,
                organs: vec![],
                traits: row.get::<_, Json<_>>(4)?.0,
                cd: row.get(5)?,
                bytes: row.get(6)?,
                scale_source: row.get::<_, Word<_>>(7)?.0,
                record: None,
                camera: None,
                warnings: row.get::<_, Json<_>>(8)?.0,
                ms: None,
            };
            Ok((row.get(0)?, plant))
        });
        let Some((seq, mut plant)) = found.optional().doing("reading a plant")? else { return Ok(None) };
        plant.organs = self.organs(seq)?;
        Ok(Some(plant))
    }

    fn organs(&self, plant: i64) -> Result<Vec<OrganReport>, StoreError> {
        let sql = "SELECT id, kind, parent, leaf, points, residual, visible_fraction, traits
            FROM organs WHERE plant = ?1 ORDER BY id";
        let mut statement = self.connection.prepare_cached(sql).doing("reading organs")?;
        let organ = |row: &Row<'_>| {
            Ok(OrganReport {
                id: row.get(0)?,
                kind: row.get::<_, Word<_>>(1)?.0,
                parent: row.get(2)?,
                leaf: row.get(3)?,
                points: row.get(4)?,
                residual: row.get(5)?,
                visible_fraction: row.get(6)?,
                traits: row.get::<_, Json<_>>(7)?.0,
            })
        };
        statement.query_map([plant], organ).doing("reading organs")?.collect::<Result<_, _>>().doing("reading organs")
    }

    /// A plant's compact record with what decodes it, `None` where the id is unknown.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn record(&self, id: &str) -> Result<Option<StoredRecord>, StoreError> {
        let sql = "SELECT p.record, s.file FROM plants p JOIN species s ON s.hash = p.species WHERE p.id = ?1";
        let found =
            self.connection.query_row(sql, [id], |row| Ok(StoredRecord { record: row.get(0)?, species: row.get(1)? }));
        found.optional().doing("reading a record")
    }

    /// A plant's picture (PNG), `None` where the plant is unknown or has none.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn thumbnail(&self, id: &str) -> Result<Option<Vec<u8>>, StoreError> {
        let found = self.connection.query_row("SELECT thumbnail FROM plants WHERE id = ?1", [id], |row| row.get(0));
        Ok(found.optional().doing("reading a picture")?.flatten())
    }

    /// What is in the store.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be read.
    pub fn summary(&self) -> Result<Summary, StoreError> {
        let sql = "SELECT (SELECT count(*) FROM plants), (SELECT count(*) FROM outbox),
            (SELECT time FROM plants ORDER BY seq DESC LIMIT 1)";
        let (plants, unsent, last_plant) = self
            .connection
            .query_row(sql, [], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))
            .doing("counting plants")?;
        let sql = "SELECT s.id, s.rig, count(p.seq) FROM sessions s LEFT JOIN plants p ON p.session = s.id
            GROUP BY s.id ORDER BY s.rowid";
        let mut statement = self.connection.prepare_cached(sql).doing("listing sessions")?;
        let row = |row: &Row<'_>| Ok(SessionRow { id: row.get(0)?, rig: row.get(1)?, plants: row.get(2)? });
        let rows = statement.query_map([], row).doing("listing sessions")?;
        let sessions = rows.collect::<Result<_, _>>().doing("listing sessions")?;
        Ok(Summary { plants, unsent, last_plant, sessions })
    }
}

pub(super) fn plant_row(row: &Row<'_>) -> rusqlite::Result<PlantRow> {
    let all = |a: Option<f64>, b: Option<f64>| a.zip(b);
    let ground = all(row.get("x")?, row.get("y")?);
    let up: Option<f64> = row.get("z")?;
    Ok(PlantRow {
        seq: row.get("seq")?,
        id: row.get("id")?,
        session: row.get("session")?,
        species: row.get("species")?,
        time: row.get("time")?,
        time_trusted: row.get("time_trusted")?,
        scale_source: row.get::<_, Word<_>>("scale_source")?.0,
        position: ground.zip(up).map(|((x, y), z)| [x, y, z]),
        geographic: all(row.get("latitude")?, row.get("longitude")?).map(|(a, b)| [a, b]),
        height: row.get("height")?,
        leaf_count: row.get("leaf_count")?,
        blade_count: row.get("blade_count")?,
        leaf_area: row.get("leaf_area")?,
        cd: row.get("cd")?,
        bytes: row.get("bytes")?,
        thumbnail: row.get("thumbnail")?,
    })
}

/// A column of JSON text.
struct Json<T>(T);

impl<T: DeserializeOwned> FromSql for Json<T> {
    fn column_result(value: ValueRef<'_>) -> FromSqlResult<Self> {
        serde_json::from_str(value.as_str()?).map(Self).map_err(FromSqlError::other)
    }
}

/// A column that holds the contract's word for a plain enum.
struct Word<T>(T);

impl<T: DeserializeOwned> FromSql for Word<T> {
    fn column_result(value: ValueRef<'_>) -> FromSqlResult<Self> {
        serde_json::from_value(value.as_str()?.into()).map(Self).map_err(FromSqlError::other)
    }
}
