//! How the file is opened: what it is, the settings of every connection, the migrations.

use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, OpenFlags, TransactionBehavior};

use super::error::{Doing, StoreError};

/// "DMTR": what `file` and this program know a store by.
pub const APPLICATION_ID: i32 = 0x444D_5452;

/// One file a step of `user_version`; a file that has shipped never changes again.
const MIGRATIONS: [&str; 3] = [
    include_str!("migrations/0001_first.sql"),
    include_str!("migrations/0002_sync.sql"),
    include_str!("migrations/0003_brapi.sql"),
];

/// What the log beside the store grows to before it is brought into the file, bytes: a guess at twenty plants with their
/// pictures.
pub(super) const LOG_CAP: u64 = 2 << 20;

/// Settings of every connection and what SQLite must answer (spec/reliability.md "Storage" 3).
const PRAGMAS: [(&str, &str); 8] = [
    // An acknowledged record has been through fsync: NORMAL would lose the last ones in a power cut.
    ("synchronous", "2"),
    ("foreign_keys", "1"),
    // A damaged or forged schema must not call functions, and damaged pages are found when read.
    ("trusted_schema", "0"),
    ("cell_size_check", "1"),
    // With mmap an I/O error is a signal that kills the program, without it an error that can be handled.
    ("mmap_size", "0"),
    // [`LOG_CAP`] in pages of 4 KiB, and in bytes: a log that grew beyond it once is cut back.
    ("wal_autocheckpoint", "512"),
    ("journal_size_limit", "2097152"),
    // Settled at migration, checked here: readers never block the writer.
    ("journal_mode", "wal"),
];

/// How long a connection waits for another process's write: a guess well above one transaction.
const BUSY: Duration = Duration::from_secs(5);

/// Opens for writing: creates the file where there is none, and migrates it to the newest schema. Its group may read it:
/// records are no secret, and operators are in the group of the service. SQLite gives its files beside it the same mode.
pub(super) fn writer(path: &Path) -> Result<Connection, StoreError> {
    let io = |source| StoreError::Io { path: path.into(), source };
    if !path.exists() {
        OpenOptions::new().create(true).append(true).mode(0o640).open(path).map_err(io)?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // The new name must survive a power cut as well as the file.
        File::open(folder).and_then(|folder| folder.sync_all()).map_err(io)?;
    }
    // Looked at read-only first, so that a file that is refused is not touched.
    if File::open(path).and_then(|file| file.metadata()).map_err(io)?.len() > 0 {
        inspect(&open(path, OpenFlags::SQLITE_OPEN_READ_ONLY)?, path)?;
    }
    let mut connection = open(path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
    connection.pragma_update(None, "journal_mode", "wal").map_err(|error| refused(path, error))?;
    settle(&connection, path)?;
    migrate(&mut connection, path)?;
    Ok(connection)
}

/// Opens an existing store for reading.
pub(super) fn reader(path: &Path) -> Result<Connection, StoreError> {
    if !path.exists() {
        return Err(StoreError::Missing { path: path.into() });
    }
    let connection = open(path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
    let version = inspect(&connection, path)?;
    if version < MIGRATIONS.len() {
        // An older store is brought up by its writer; readers of this program know the newest schema alone.
        drop(writer(path)?);
    }
    settle(&connection, path)?;
    Ok(connection)
}

fn open(path: &Path, mode: OpenFlags) -> Result<Connection, StoreError> {
    let connection =
        Connection::open_with_flags(path, mode | OpenFlags::SQLITE_OPEN_NO_MUTEX).doing("opening the file")?;
    connection.busy_timeout(BUSY).doing("setting the busy timeout")?;
    Ok(connection)
}

/// The schema's version, or why the file is refused.
fn inspect(connection: &Connection, path: &Path) -> Result<usize, StoreError> {
    let number = |pragma| connection.pragma_query_value(None, pragma, |row| row.get::<_, i32>(0));
    let id = number("application_id").map_err(|error| refused(path, error))?;
    let version = number("user_version").map_err(|error| refused(path, error))?;
    if id != APPLICATION_ID {
        let found = format!("an SQLite file with application_id {id:#010x}");
        return Err(StoreError::NotAStore { path: path.into(), found });
    }
    let found = usize::try_from(version).unwrap_or(0);
    if found > MIGRATIONS.len() {
        return Err(StoreError::NewerSchema { path: path.into(), expected: MIGRATIONS.len(), found });
    }
    Ok(found)
}

fn refused(path: &Path, source: rusqlite::Error) -> StoreError {
    match source.sqlite_error_code() {
        Some(ErrorCode::NotADatabase | ErrorCode::DatabaseCorrupt) => {
            StoreError::NotAStore { path: path.into(), found: source.to_string() }
        }
        _ => StoreError::Sqlite { doing: "reading the file's header", source },
    }
}

/// Makes the settings and reads them back, because SQLite ignores a pragma it does not take.
fn settle(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    for (pragma, expected) in PRAGMAS {
        if pragma != "journal_mode" {
            connection.pragma_update(None, pragma, expected).doing("setting a pragma")?;
        }
    }
    for ((pragma, found), (_, expected)) in pragmas(connection)?.into_iter().zip(PRAGMAS) {
        if found != expected {
            return Err(StoreError::Pragma { path: path.into(), pragma, expected, found });
        }
    }
    Ok(())
}

/// The settings in force.
pub(super) fn pragmas(connection: &Connection) -> Result<Vec<(&'static str, String)>, StoreError> {
    let text = |value: rusqlite::types::Value| match value {
        rusqlite::types::Value::Integer(number) => number.to_string(),
        rusqlite::types::Value::Text(text) => text,
        other => format!("{other:?}"),
    };
    let read = |(pragma, _)| {
        let found = connection.pragma_query_value(None, pragma, |row| row.get(0)).doing("reading a pragma")?;
        Ok((pragma, text(found)))
    };
    PRAGMAS.into_iter().map(read).collect()
}

fn migrate(connection: &mut Connection, path: &Path) -> Result<(), StoreError> {
    loop {
        // Immediate, and the version is read inside: of two programs starting at once one migrates.
        let step =
            connection.transaction_with_behavior(TransactionBehavior::Immediate).doing("beginning to migrate")?;
        let version: usize =
            step.pragma_query_value(None, "user_version", |row| row.get(0)).doing("reading user_version")?;
        let Some(sql) = MIGRATIONS.get(version) else { break };
        if version == 0 {
            let tables: u32 =
                step.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0)).doing("counting tables")?;
            if tables > 0 {
                let found = format!("an SQLite file with {tables} tables of its own");
                return Err(StoreError::NotAStore { path: PathBuf::from(path), found });
            }
            step.pragma_update(None, "application_id", APPLICATION_ID).doing("setting application_id")?;
        }
        step.execute_batch(sql).doing("migrating")?;
        step.pragma_update(None, "user_version", version + 1).doing("setting user_version")?;
        step.commit().doing("committing a migration")?;
        tracing::debug!(schema = version + 1, "migrated");
    }
    Ok(())
}
