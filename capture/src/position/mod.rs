//! Where the rig is: fixes of a satellite receiver, from gpsd or as NMEA sentences, over the time of the frames.
//!
//! ```text
//! Port (TCP, serial line, file) ─► Lines ─► Nmea | gpsd ─► Fix ─► Positions: a Track a boot, and how the receiver does
//! ```
//!
//! A [`Receiver`] has a thread that reads and, whatever happens, begins again. Nothing that comes down the line stops it:
//! what cannot be used is counted by its [`Fault`]. Time between two fixes is bridged, a lost fix is a gap.

mod fault;
mod fix;
mod gpsd;
mod health;
mod lines;
mod nmea;
mod port;
mod positions;
mod receiver;
#[cfg(test)]
mod tests;
mod track;

pub use fault::Fault;
pub use fix::{Fix, Quality};
pub use health::{PositionHealth, PositionState};
pub use port::ReceiverSource;
pub use positions::Positions;
pub use receiver::{Receiver, ReceiverSettings};
