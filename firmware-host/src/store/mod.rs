//! The store: one SQLite file that never loses an acknowledged plant (spec/appliance.md "Store").
//!
//! [`Store`] writes, one at a time; [`Reader`] reads beside it. Neither knows the pipeline or the page.

mod brapi;
mod connection;
mod error;
mod outbox;
mod plant;
mod read;
mod reserve;
mod whole;
mod write;

pub use connection::APPLICATION_ID;
pub use error::StoreError;
pub use outbox::{Batch, Outbox, Waiting};
pub use plant::{NewPlant, NewSession};
pub use read::{Page, PlantRow, Reader, SessionRow, StoredRecord, Summary};
pub use reserve::Reserve;
pub use whole::WholePlant;
pub use write::{Saved, Store};
