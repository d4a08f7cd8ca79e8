use std::collections::VecDeque;

use parquet::errors::ParquetError;
use serde::{Deserialize, Serialize};

use super::backoff::Backoff;
use super::brapi::Brapi;
use super::clock::SyncClock;
use super::destination::Destination;
use super::error::SendError;
use super::pack::pack;
use crate::error::CommandError;
use crate::store::{Reader, Store, StoreError};
use crate::tables;

/// Why nothing is tried: the time in a certificate could not be judged.
pub(crate) const NO_TIME: &str = "waits until the clock is synchronised";

/// Tries after which a batch lets newer plants go first: it may be the batch that is wrong and not the server.
const STUBBORN: u32 = 8;
/// Objects in one pass that come back wrong before the server itself is taken for broken.
const DOUBTS: u32 = 3;
/// Passes in a row that bring nothing before a command gives up.
const FRUITLESS: u32 = 3;

/// Sends what waits in a store to a destination.
#[derive(Debug)]
pub struct Syncer<'a, C> {
    /// The store's writer.
    pub store: &'a Store,
    /// A reader beside it.
    pub reader: Reader,
    /// Where plants go.
    pub destination: Destination,
    /// Where their traits go, too.
    pub brapi: Option<Brapi>,
    /// The time, and whether it is right.
    pub clock: C,
    /// The clock is right whatever it says itself.
    pub trusting: bool,
    /// Most plants in one table.
    pub plants_a_table: usize,
}

/// How a pass ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// Plants that left.
    pub sent: usize,
    /// Objects that arrived.
    pub objects: usize,
    /// Plants that wait.
    pub left: u64,
    /// Plants that arrived at the BrAPI server.
    pub observed: usize,
    /// Plants that wait for it.
    pub unobserved: usize,
    /// Why some wait.
    pub failure: Option<String>,
}

impl Pass {
    /// Nothing waits any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.left == 0 && self.unobserved == 0
    }

    /// Something arrived.
    #[must_use]
    pub fn brought(&self) -> bool {
        self.objects > 0 || self.observed > 0
    }
}

/// The store broke, or the tables could not be written.
#[derive(Debug, thiserror::Error)]
pub enum PassError {
    /// The store's own.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The tables'.
    #[error("sync: writing tables: {0}")]
    Tables(#[from] ParquetError),
}

impl From<PassError> for CommandError {
    fn from(error: PassError) -> Self {
        match error {
            PassError::Store(error) => error.into(),
            PassError::Tables(_) => Self::failed("sync", &error),
        }
    }
}

/// Why a batch is not there.
#[derive(Debug, thiserror::Error)]
enum Undone {
    #[error(transparent)]
    Broken(#[from] PassError),
    #[error(transparent)]
    Refused(#[from] SendError),
}

impl From<StoreError> for Undone {
    fn from(error: StoreError) -> Self {
        Self::Broken(error.into())
    }
}

impl<C: SyncClock> Syncer<'_, C> {
    /// Tries each batch once, those that were tried least first, and stops where the server fails. Dropped in the
    /// middle, it loses at most the object on its way.
    ///
    /// # Errors
    /// [`PassError`] when the store breaks; what the server does is no error but told by [`Pass`] and noted with every
    /// plant that waits.
    pub async fn pass(&self) -> Result<Pass, PassError> {
        let mut pass = Pass::default();
        if self.trusting || self.clock.trusted() {
            self.send(&mut pass).await?;
            self.observe(&mut pass).await?;
        } else {
            self.store.note_waiting(NO_TIME)?;
            pass.failure = Some(NO_TIME.into());
        }
        pass.left = self.reader.summary()?.unsent;
        if let Some(brapi) = &self.brapi {
            pass.unobserved = self.reader.without_unit(&brapi.name())?.len();
        }
        Ok(pass)
    }

    /// Each plant that is not at the BrAPI server, whether it has left otherwise or not.
    async fn observe(&self, pass: &mut Pass) -> Result<(), PassError> {
        let Some(brapi) = &self.brapi else { return Ok(()) };
        let mut doubts = 0;
        for seq in self.reader.without_unit(&brapi.name())? {
            let Some(plant) = self.reader.whole(&[seq])?.pop() else { continue };
            let refused = match brapi.send(&plant, self.reader.number_in_session(seq)?).await {
                Ok(unit) => {
                    self.store.save_unit(seq, &brapi.name(), &unit, self.clock.now())?;
                    pass.observed += 1;
                    continue;
                }
                Err(refused) => refused,
            };
            let reason = refused.to_string();
            tracing::warn!("brapi: {reason}");
            self.store.note_unit(seq, &brapi.name(), self.clock.now(), &reason)?;
            pass.failure.get_or_insert(reason);
            doubts += 1;
            if matches!(refused, SendError::Server { .. }) || doubts == DOUBTS {
                break;
            }
        }
        Ok(())
    }

    async fn send(&self, pass: &mut Pass) -> Result<(), PassError> {
        let batches = self.reader.batches()?.into_iter();
        let (mut usual, mut stubborn): (VecDeque<_>, VecDeque<_>) = batches.partition(|(_, tries)| *tries < STUBBORN);
        let mut doubts = 0;
        loop {
            let next = match usual.pop_front() {
                Some((batch, _)) => Some(batch),
                None => pack(self.store, &self.reader, self.plants_a_table)?.or_else(|| Some(stubborn.pop_front()?.0)),
            };
            let Some(batch) = next else { return Ok(()) };
            let refused = match self.send_batch(batch, &mut pass.objects).await {
                Ok(()) => {
                    pass.sent += self.store.retire(batch, self.destination.name(), self.clock.now())?;
                    continue;
                }
                Err(Undone::Broken(error)) => return Err(error),
                Err(Undone::Refused(refused)) => refused,
            };
            let reason = refused.to_string();
            tracing::warn!("sync: {reason}");
            self.store.note_try(batch, self.clock.now(), &reason)?;
            doubts += 1;
            let ends = matches!(refused, SendError::Server { .. }) || doubts == DOUBTS;
            if ends {
                self.store.note_waiting(&reason)?;
            }
            pass.failure = Some(reason);
            if ends {
                return Ok(());
            }
        }
    }

    /// What the rows point at goes first, the table of plants last: a reader of the bucket finds whatever it names.
    async fn send_batch(&self, batch: i64, objects: &mut usize) -> Result<(), Undone> {
        for file in self.reader.batch_species(batch)? {
            let key = format!("species/{}.safetensors", tables::hash(&file));
            // Later plants need it too, so it is remembered beyond this batch.
            *objects += self.object(&key, &file, None).await?;
        }
        for plant in self.reader.batch_plants(batch)? {
            if let Some(png) = self.reader.thumbnail(&plant)? {
                *objects += self.object(&format!("blobs/{}.png", tables::hash(&png)), &png, Some(batch)).await?;
            }
        }
        let tables = self.reader.batch(batch)?;
        *objects += self.object(&tables.organs_key, &tables.organs, Some(batch)).await?;
        *objects += self.object(&tables.plants_key, &tables.plants, Some(batch)).await?;
        Ok(())
    }

    /// Sends an object unless it is known to be there; how many were sent.
    async fn object(&self, key: &str, bytes: &[u8], batch: Option<i64>) -> Result<usize, Undone> {
        if self.reader.uploaded(self.destination.name(), key)? {
            return Ok(0);
        }
        self.destination.send(key, bytes).await?;
        self.store.save_upload(self.destination.name(), key, batch, self.clock.now())?;
        Ok(1)
    }
}

/// Passes until nothing waits or three in a row brought nothing; what they did together.
///
/// # Errors
/// As [`Syncer::pass`].
pub async fn until_done<C: SyncClock>(syncer: &Syncer<'_, C>, backoff: &mut Backoff) -> Result<Pass, PassError> {
    let mut total = Pass::default();
    loop {
        let pass = syncer.pass().await?;
        if pass.brought() {
            backoff.succeeded();
        }
        total = Pass {
            sent: total.sent + pass.sent,
            objects: total.objects + pass.objects,
            observed: total.observed + pass.observed,
            ..pass
        };
        if total.is_over() {
            return Ok(total);
        }
        let wait = backoff.failed();
        if backoff.failures() >= FRUITLESS {
            return Ok(total);
        }
        let waiting = total.left.max(total.unobserved as u64);
        tracing::info!("sync: {waiting} plants wait; next try in {} s", wait.as_secs());
        syncer.clock.sleep(wait).await;
    }
}
