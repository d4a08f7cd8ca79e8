use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use demeter_recon::model::Species;
use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior, params};
use serde::Serialize;

use super::connection;
use super::error::{Doing, StoreError};
use super::plant::{NewPlant, NewSession};
use super::read::Reader;
use crate::report::OrganReport;

/// The store's one writer.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    connection: Mutex<Connection>,
}

/// What saving did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// The plant is new.
    New,
    /// The very same was there already.
    Same,
}

impl Store {
    /// Opens a store, creating and migrating it as needed.
    ///
    /// # Errors
    /// [`StoreError::NewerSchema`] and [`StoreError::NotAStore`] leave the file as it is.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Ok(Self { path: path.into(), connection: Mutex::new(connection::writer(path)?) })
    }

    /// A reader of the same file.
    ///
    /// # Errors
    /// [`StoreError`] when the file cannot be opened a second time.
    pub fn reader(&self) -> Result<Reader, StoreError> {
        Reader::open(&self.path)
    }

    /// The settings in force on this connection, by name.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when they cannot be read.
    pub fn pragmas(&self) -> Result<Vec<(&'static str, String)>, StoreError> {
        connection::pragmas(&self.lock())
    }

    /// Brings everything into the file itself, so that the log beside it is empty: for the end of the program.
    ///
    /// # Errors
    /// [`StoreError`] when another program reads or writes just now, or a thread of this one is stuck in the store;
    /// nothing is lost then, the next start reads the log.
    pub fn settle(&self) -> Result<(), StoreError> {
        let stuck = |_| StoreError::Busy { path: self.path.clone() };
        let connection = self.connection.try_lock().map_err(stuck)?;
        // The program is about to end and the power may be, too.
        connection.busy_timeout(Duration::from_millis(500)).doing("setting the busy timeout")?;
        let busy: bool = connection
            .query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |row| row.get(0))
            .doing("writing the log into the file")?;
        if busy { Err(StoreError::Busy { path: self.path.clone() }) } else { Ok(()) }
    }

    /// Saves a session with its rig and cameras; the same again changes nothing.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the session had another rig, or a camera another calibration.
    pub fn save_session(&self, session: &NewSession) -> Result<(), StoreError> {
        self.transaction("saving a session", |t| {
            t.execute("INSERT OR IGNORE INTO rigs (id) VALUES (?1)", [&session.rig]).doing("saving a rig")?;
            t.execute("INSERT OR IGNORE INTO sessions (id, rig) VALUES (?1, ?2)", [&session.id, &session.rig])
                .doing("saving a session")?;
            let rig: String = t
                .query_row("SELECT rig FROM sessions WHERE id = ?1", [&session.id], |row| row.get(0))
                .doing("reading a session")?;
            if rig != session.rig {
                return Err(StoreError::Conflict { what: "session", id: session.id.clone() });
            }
            for (camera, calibration) in &session.cameras {
                let calibration = calibration.to_string();
                t.execute(
                    "INSERT OR IGNORE INTO cameras (session, id, calibration) VALUES (?1, ?2, ?3)",
                    [&session.id, camera, &calibration],
                )
                .doing("saving a camera")?;
                let stored: String = t
                    .query_row(
                        "SELECT calibration FROM cameras WHERE session = ?1 AND id = ?2",
                        [&session.id, camera],
                        |row| row.get(0),
                    )
                    .doing("reading a camera")?;
                if stored != calibration {
                    return Err(StoreError::Conflict { what: "camera", id: format!("{}/{camera}", session.id) });
                }
            }
            Ok(())
        })
    }

    /// Keeps a species file, so that the records that name it stay decodable for ever.
    ///
    /// # Errors
    /// [`StoreError`] when it cannot be serialised or written.
    pub fn save_species(&self, species: &Species) -> Result<(), StoreError> {
        let file = species.to_bytes().map_err(|error| StoreError::Value {
            id: species.name.clone(),
            key: "species".into(),
            expected: "a species that can be written",
            found: error.to_string(),
        })?;
        let values = params![species.hash(), species.name, file];
        self.lock()
            .execute("INSERT OR IGNORE INTO species (hash, name, file) VALUES (?1, ?2, ?3)", values)
            .doing("saving a species")?;
        Ok(())
    }

    /// Keeps the name of a network by the SHA-256 (hexadecimal) of its file.
    ///
    /// # Errors
    /// [`StoreError::Sqlite`] when it cannot be written.
    pub fn save_model(&self, sha256: &str, name: &str) -> Result<(), StoreError> {
        self.lock()
            .execute("INSERT OR IGNORE INTO models (sha256, name) VALUES (?1, ?2)", [sha256, name])
            .doing("saving a model")?;
        Ok(())
    }

    /// Saves a plant with everything that belongs to it and its outbox row, in one transaction. When this returns,
    /// it has been through fsync.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the id is taken by another body, [`StoreError::Value`] when a number is not
    /// finite or the id has characters that an address has not; nothing is written then.
    pub fn save_plant(&self, plant: &NewPlant) -> Result<Saved, StoreError> {
        let id = plant.checked()?;
        let body = plant.body().doing("hashing a plant")?;
        self.transaction("saving a plant", |t| {
            let stored: Option<[u8; 32]> = t
                .query_row("SELECT body FROM plants WHERE id = ?1", [id], |row| row.get(0))
                .optional()
                .doing("looking for a plant")?;
            match stored {
                Some(stored) if stored == *body.as_bytes() => return Ok(Saved::Same),
                Some(_) => return Err(StoreError::Conflict { what: "plant", id: id.to_owned() }),
                None => {}
            }
            let seq = insert_plant(t, id, &body, plant)?;
            for organ in &plant.report.organs {
                insert_organ(t, seq, organ)?;
            }
            for model in &plant.models {
                t.execute("INSERT INTO plant_models (plant, model) VALUES (?1, ?2)", params![seq, model])
                    .doing("saving a plant's model")?;
            }
            for (camera, frame) in &plant.observations {
                let values = params![seq, plant.session, camera, frame];
                t.execute("INSERT INTO observations (plant, session, camera, frame) VALUES (?1, ?2, ?3, ?4)", values)
                    .doing("saving an observation")?;
            }
            t.execute("INSERT INTO outbox (plant) VALUES (?1)", [seq]).doing("saving an outbox row")?;
            Ok(Saved::New)
        })
    }

    /// Notes what happened, at a time that the caller's clock gives.
    ///
    /// # Errors
    /// [`StoreError`] when it cannot be written.
    pub fn save_event(&self, time: jiff::Timestamp, kind: &str, detail: &impl Serialize) -> Result<(), StoreError> {
        let detail = serde_json::to_string(detail).doing("writing an event")?;
        self.lock()
            .execute(
                "INSERT INTO events (time, kind, detail) VALUES (?1, ?2, ?3)",
                params![time.to_string(), kind, detail],
            )
            .doing("saving an event")?;
        Ok(())
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Connection> {
        // A panic while holding the lock dropped its transaction, which rolled back: the connection is as good as new.
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn transaction<T>(
        &self,
        doing: &'static str,
        work: impl FnOnce(&Transaction<'_>) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let mut connection = self.lock();
        // Immediate: waiting for another writer happens here and not in the middle, where it could deadlock.
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate).doing(doing)?;
        // An error drops the transaction, which rolls it back.
        let result = work(&transaction)?;
        transaction.commit().doing(doing)?;
        Ok(result)
    }
}

fn insert_plant(t: &Transaction<'_>, id: &str, body: &blake3::Hash, plant: &NewPlant) -> Result<i64, StoreError> {
    let report = &plant.report;
    let value = |key: &str| report.traits.get(key).map(|quantity| quantity.value);
    let json = |value: &serde_json::Value| value.to_string();
    t.execute(
        "INSERT INTO plants (id, body, session, species, record, time, time_trusted, scale_source, x, y, z, latitude,
             longitude, height, leaf_count, blade_count, leaf_area, cd, traits, warnings, provenance, thumbnail)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20, ?21, ?22)",
        params![
            id,
            body.as_bytes(),
            plant.session,
            report.species_hash,
            plant.record,
            plant.time,
            plant.time_trusted,
            word(&report.scale_source)?,
            plant.position.map(|p| p.x),
            plant.position.map(|p| p.y),
            plant.position.map(|p| p.z),
            plant.geographic.map(|g| g[0]),
            plant.geographic.map(|g| g[1]),
            value("height"),
            value("leaf_count"),
            value("blade_count"),
            value("leaf_area"),
            report.cd,
            serde_json::to_string(&report.traits).doing("writing traits")?,
            serde_json::to_string(&report.warnings).doing("writing warnings")?,
            json(&plant.provenance),
            plant.thumbnail,
        ],
    )
    .doing("saving a plant")?;
    Ok(t.last_insert_rowid())
}

fn insert_organ(t: &Transaction<'_>, plant: i64, organ: &OrganReport) -> Result<(), StoreError> {
    t.execute(
        "INSERT INTO organs (plant, id, kind, parent, leaf, points, residual, visible_fraction, traits)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
        params![
            plant,
            organ.id,
            word(&organ.kind)?,
            organ.parent,
            organ.leaf,
            organ.points,
            organ.residual,
            organ.visible_fraction,
            serde_json::to_string(&organ.traits).doing("writing an organ's traits")?,
        ],
    )
    .doing("saving an organ")?;
    Ok(())
}

/// The contract's word for a plain enum.
fn word(value: &impl Serialize) -> Result<String, StoreError> {
    let value = serde_json::to_value(value).doing("naming a value")?;
    Ok(value.as_str().unwrap_or_default().to_owned())
}
