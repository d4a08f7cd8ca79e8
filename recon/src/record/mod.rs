//! A plant's record: its parameters as bytes, exact or compact (spec/demeter-model.md "A plant's record").
//!
//! Every record is framed alike; numbers are little-endian, varints as in LEB128:
//!
//! | bytes | what |
//! |---|---|
//! | 4 | `DMPL` |
//! | 1 | version of the layout, 1 |
//! | 1 | encoding in the low four bits (0 exact, 1 compact), [`ScaleSource`] in the high four, in the order of its variants |
//! | 1 + n | length n of the species' name (1..=255) and the name, UTF-8 |
//! | 4 | first bytes of the species file's BLAKE3 hash |
//! | 1..=2 | number of organs, varint |
//! | ... | the body: see [`exact`] and [`compact`] |
//! | 4 | first bytes of the BLAKE3 hash of all bytes before |
//!
//! A record is worthless without its species: it holds coefficients, the species file holds what they multiply.

mod coder;
pub mod compact;
pub mod exact;
mod quanta;

use std::borrow::Borrow;

use demeter_frame::Pose;

use crate::model::{Form, Plant, PlantError, Species};
use crate::organs::ScaleSource;

pub use compact::encode_compact;
pub use exact::encode_exact;

const MAGIC: [u8; 4] = *b"DMPL";
const VERSION: u8 = 1;
const EXACT: u8 = 0;
const COMPACT: u8 = 1;
const CHECKSUM_BYTES: usize = 4;
/// The order is the format's: it may grow at its end.
const SCALE_SOURCES: [ScaleSource; 6] = [
    ScaleSource::Stereo,
    ScaleSource::GroundPlane,
    ScaleSource::Target,
    ScaleSource::MetricModel,
    ScaleSource::Input,
    ScaleSource::None,
];

/// Which species file a record needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpeciesRef {
    /// Name of the species.
    pub name: String,
    /// First bytes of its file's BLAKE3 hash.
    pub hash: [u8; 4],
}

impl SpeciesRef {
    /// The reference to a species.
    #[must_use]
    pub fn of(species: &Species) -> Self {
        let byte = |i: usize| species.hash().get(2 * i..2 * i + 2).and_then(|hex| u8::from_str_radix(hex, 16).ok());
        Self { name: species.name.clone(), hash: [0, 1, 2, 3].map(|i| byte(i).unwrap_or(0)) }
    }
}

impl std::fmt::Display for SpeciesRef {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:08x}", self.name, u32::from_be_bytes(self.hash))
    }
}

/// A decoded record.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The plant.
    pub plant: Plant,
    /// Its species.
    pub species: SpeciesRef,
    /// Where its metric scale comes from.
    pub scale_source: ScaleSource,
}

/// Why a plant has no record or bytes are none.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum RecordError {
    /// Not a record, or cut short before its species.
    #[error("record: expected a plant record of at least {expected} bytes, found {found}")]
    NoRecord {
        /// Least size of what was sought.
        expected: usize,
        /// What is there.
        found: String,
    },
    /// Written by a newer program.
    #[error("record: expected layout version {expected}, found {found}")]
    Version {
        /// The newest version known here.
        expected: u8,
        /// The record's.
        found: u8,
    },
    /// The checksum does not fit the bytes.
    #[error("record: expected checksum {expected:08x}, found {found:08x}")]
    Checksum {
        /// The checksum of the bytes.
        expected: u32,
        /// The one they carry.
        found: u32,
    },
    /// Bytes whose checksum fits and that still make no plant.
    #[error("record: damaged, found {found}")]
    Damaged {
        /// What is wrong.
        found: &'static str,
    },
    /// The species is not at hand, or another version of it is.
    #[error("record: expected species {expected}, found {found}")]
    Species {
        /// What the record names.
        expected: String,
        /// What was at hand.
        found: String,
    },
    /// The plant is none.
    #[error("record: {0}")]
    Plant(#[from] PlantError),
    /// More coefficients than the species has components, or a name of more than 255 bytes.
    #[error("record {what}: expected at most {expected}, found {found}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// The bound.
        expected: usize,
        /// How many.
        found: usize,
    },
    /// A number that the encoding cannot hold.
    #[error("record {what}: expected {expected}, found {found}")]
    Range {
        /// Which number.
        what: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: f64,
    },
    /// A plant so wild that no quantum keeps its vertices in place.
    #[error("compact record: expected vertices within {expected} of the diagonal, found {found}")]
    Precision {
        /// The goal, in diagonals.
        expected: f64,
        /// What the finest quantum reaches.
        found: f64,
    },
}

/// Reads a record of either encoding. `resolve` finds the species (or a reference to one) that the record names.
///
/// # Errors
/// [`RecordError`]; no bytes make it panic, allocate more than some megabytes or give a plant that is none.
pub fn decode<S: Borrow<Species>>(
    bytes: &[u8],
    resolve: impl Fn(&SpeciesRef) -> Option<S>,
) -> Result<Record, RecordError> {
    let frame = Frame::read(bytes)?;
    let (content, carried) = bytes.split_at(bytes.len() - CHECKSUM_BYTES);
    let (expected, found) = (checksum(content), u32_of(carried));
    if expected != found {
        return Err(RecordError::Checksum { expected, found });
    }
    let missing = |found: String| RecordError::Species { expected: frame.species.to_string(), found };
    let species = resolve(&frame.species).ok_or_else(|| missing("no such species".into()))?;
    let species = species.borrow();
    let found = SpeciesRef::of(species);
    if found != frame.species {
        return Err(missing(found.to_string()));
    }
    let plant = match frame.encoding {
        EXACT => exact::read(frame.body, frame.organs, species)?,
        COMPACT => compact::read(frame.body, frame.organs, species)?,
        _ => return Err(RecordError::Damaged { found: "an unknown encoding" }),
    };
    plant.validate()?;
    Ok(Record { plant, species: frame.species, scale_source: frame.scale_source })
}

/// Which species a record needs, without decoding it; the checksum is not looked at.
///
/// # Errors
/// [`RecordError`] when the bytes do not begin like a record.
pub fn peek(bytes: &[u8]) -> Result<SpeciesRef, RecordError> {
    Ok(Frame::read(bytes)?.species)
}

/// What surrounds a body.
struct Frame<'a> {
    encoding: u8,
    scale_source: ScaleSource,
    species: SpeciesRef,
    organs: usize,
    body: &'a [u8],
}

impl<'a> Frame<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self, RecordError> {
        let short = |expected: usize| RecordError::NoRecord { expected, found: format!("{} bytes", bytes.len()) };
        let take = |from: usize, count: usize| {
            let end = from.saturating_add(count);
            bytes.get(from..end).ok_or(short(end + CHECKSUM_BYTES))
        };
        if take(0, 4)? != MAGIC {
            return Err(RecordError::NoRecord { expected: 4, found: "another kind of file".into() });
        }
        let [version, packing, name_bytes] = [take(4, 1)?[0], take(5, 1)?[0], take(6, 1)?[0]];
        if version != VERSION {
            return Err(RecordError::Version { expected: VERSION, found: version });
        }
        let damaged = |found| RecordError::Damaged { found };
        let scale_source =
            *SCALE_SOURCES.get(usize::from(packing >> 4)).ok_or(damaged("an unknown source of the scale"))?;
        let name_end = 7 + usize::from(name_bytes);
        let name = std::str::from_utf8(take(7, name_end - 7)?).map_err(|_utf8| damaged("a name that is no text"))?;
        let mut hash = [0; 4];
        hash.copy_from_slice(take(name_end, 4)?);
        let mut at = name_end + 4;
        let mut organs = 0;
        for shift in [0, 7] {
            let byte = take(at, 1)?[0];
            organs |= usize::from(byte & 0x7f) << shift;
            at += 1;
            if byte < 0x80 {
                break;
            }
        }
        if organs == 0 || organs > Plant::MAX_ORGANS {
            return Err(damaged("no number of organs"));
        }
        let end = bytes.len().checked_sub(CHECKSUM_BYTES).filter(|end| *end >= at);
        let body = &bytes[at..end.ok_or(short(at + CHECKSUM_BYTES))?];
        let species = SpeciesRef { name: name.to_owned(), hash };
        Ok(Self { encoding: packing & 15, scale_source, species, organs, body })
    }
}

/// Puts the frame around a body and reads the whole back, so that no record leaves that cannot be read.
fn frame(
    plant: &Plant,
    species: &Species,
    scale_source: ScaleSource,
    encoding: u8,
    body: &[u8],
) -> Result<Vec<u8>, RecordError> {
    let source = SCALE_SOURCES.iter().position(|s| *s == scale_source).unwrap_or(SCALE_SOURCES.len() - 1);
    let reference = SpeciesRef::of(species);
    let name = reference.name.as_bytes();
    let length = u8::try_from(name.len()).map_err(|_long| RecordError::TooMany {
        what: "species name",
        expected: 255,
        found: name.len(),
    })?;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([VERSION, (source as u8) << 4 | encoding, length]);
    bytes.extend(name);
    bytes.extend(reference.hash);
    let organs = plant.organs.len();
    match organs {
        0..0x80 => bytes.push(organs as u8),
        _ => bytes.extend([organs as u8 | 0x80, (organs >> 7) as u8]),
    }
    bytes.extend(body);
    bytes.extend(checksum(&bytes).to_le_bytes());
    decode(&bytes, |_| Some(species))?;
    Ok(bytes)
}

/// The plant is one, and its coefficients have components to multiply.
fn check(plant: &Plant, species: &Species) -> Result<(), RecordError> {
    plant.validate()?;
    check_place(&plant.world_from_plant)?;
    let fits = |what, coefficients: &[f64], expected: usize| {
        let found = coefficients.len();
        if found > expected { Err(RecordError::TooMany { what, expected, found }) } else { Ok(()) }
    };
    for organ in &plant.organs {
        match &organ.form {
            Form::Stem { gamma, .. } => fits("stem deformation", gamma, species.stem.deform.rank())?,
            Form::Leaf { blade, .. } => {
                fits("leaf shape", &blade.beta, species.leaf.shape.rank())?;
                fits("leaf deformation", &blade.gamma, species.leaf.deform.rank())?;
            }
        }
    }
    Ok(())
}

fn check_place(Pose { rotation, translation }: &Pose) -> Result<(), RecordError> {
    if translation.is_finite() && (rotation.length() - 1.0).abs() < 1e-6 {
        return Ok(());
    }
    let (what, expected) = ("world_from_plant", "a finite place and a unit quaternion");
    Err(RecordError::Range { what, expected, found: rotation.length() })
}

fn checksum(bytes: &[u8]) -> u32 {
    u32_of(blake3::hash(bytes).as_bytes())
}

fn u32_of(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}
