//! The nightly sync (spec/appliance.md "Sync"): plants leave the outbox as tables, pictures and species files for a
//! bucket, a WebDAV server or a mounted disk.
//!
//! Every key holds the BLAKE3 of what it names, and a plant leaves the outbox only when both its tables, its picture and
//! its species file were read back with that hash. [`Syncer`] does one pass; [`attend`] is the daemon's loop around it.
//! Objects are sent one by one and none is larger than about a megabyte, so a cut costs the one on its way.

mod answer;
mod ask;
mod attend;
mod backoff;
mod brapi;
mod clock;
mod compact;
mod destination;
mod error;
mod lock;
mod manifest;
mod pack;
mod pass;
mod secret;
mod ways;
mod wire;

pub use ask::ask;
pub use attend::{Attendant, Report, attend, start};
pub(crate) use attend::{destination, open};
pub use backoff::Backoff;
pub use brapi::Brapi;
pub use clock::SyncClock;
pub use compact::{CompactError, Compacted, LeftOut, Month, compact};
pub use destination::{Destination, Object};
pub use error::{SendError, SyncError};
pub use lock::Lock;
pub use manifest::{Manifest, Merged};
pub(crate) use pass::NO_TIME;
pub use pass::{Pass, Syncer, until_done};
pub use secret::Secret;
pub use ways::watch;
pub use wire::MAX_REPLY;
