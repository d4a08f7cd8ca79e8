//! Files that commands read and write, with errors that name them.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

use demeter_capture::{decode_photo, parse_calibration};
use demeter_frame::{Calibration, Rgb};
use demeter_recon::model::{Plant, Species};
use demeter_recon::record::{self, Record, RecordError};
use demeter_recon::species::NAMES;

use crate::error::{CommandError, Exit, chain};
use crate::mesh_file::MeshFormat;

/// Largest input file, bytes: 20 million points of a scan with colours and labels.
const MAX_BYTES: u64 = 1 << 30;

/// Reads a file whole.
///
/// # Errors
/// [`CommandError`] `file` naming it when it cannot be read or is larger than 1 GiB.
pub fn read(path: &Path) -> Result<Vec<u8>, CommandError> {
    let failed = |error: std::io::Error| file_error(path, &error);
    let mut bytes = Vec::new();
    File::open(path).map_err(failed)?.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > MAX_BYTES {
        let message = format!("{}: expected at most 1 GiB", path.display());
        return Err(CommandError { exit: Exit::Failed, kind: "file", message, expected: None, found: None });
    }
    Ok(bytes)
}

/// Reads a picture, JPEG or PNG.
///
/// # Errors
/// [`CommandError`] `file` when it cannot be read, `bad_image` when it is no picture.
pub fn photo(path: &Path) -> Result<Rgb, CommandError> {
    decode_photo(&read(path)?).map_err(|error| CommandError::failed("bad_image", &error).of(path))
}

/// Reads a calibration file: Kalibr's, ROS', OpenCV's or a JSON object of intrinsics. One camera of several in a chain is
/// named behind the file, as `chain.yaml#cam1`.
///
/// # Errors
/// [`CommandError`] `file` when it cannot be read, `calibration` (bad use) naming the file and the key.
pub fn calibration(path: &Path) -> Result<Calibration, CommandError> {
    let text = path.to_string_lossy();
    let (file, camera) = match text.rsplit_once('#') {
        Some((file, camera)) if !path.exists() => (Path::new(file), Some(camera)),
        _ => (path, None),
    };
    parse_calibration(&read(file)?, camera).map_err(|error| CommandError::usage("calibration", chain(&error)).of(path))
}

/// Writes a file whole: beside its place first, so that nobody sees half of it.
///
/// # Errors
/// [`CommandError`] `file` naming it.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let write = || {
        let mut file = File::create(&beside)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        std::fs::rename(&beside, path)
    };
    write().map_err(|error| file_error(path, &error))
}

/// Writes a species file.
///
/// # Errors
/// [`CommandError`] `species` when it cannot be serialised, `file` when it cannot be written.
pub fn write_species(path: &Path, species: &Species) -> Result<(), CommandError> {
    write(path, &species.to_bytes().map_err(|error| CommandError::failed("species", &error))?)
}

/// Writes a plant's mesh in the format that the path's extension names.
///
/// # Errors
/// [`CommandError`] `usage` for any other extension, `file` when it cannot be written.
pub fn write_mesh(path: &Path, plant: &Plant, species: &Species) -> Result<(), CommandError> {
    let Some(format) = MeshFormat::of(path) else {
        let (expected, found) = (".ply, .obj or .glb", path.display());
        return Err(
            CommandError::usage("usage", format!("--mesh: expected {expected}, found {found}")).with(expected, found)
        );
    };
    let bytes = format.encode(plant, species).map_err(|error| CommandError::failed("mesh", &error))?;
    write(path, &bytes)
}

/// The shipped species of that name, `generic:NAME` as it is before anything is learned, or the species in the file of
/// that name when it ends in `.safetensors`.
///
/// # Errors
/// [`CommandError`] `species`: exit 2 for a name that is none, listing the names there are, exit 1 for a file that is
/// refused.
pub fn species(name: &str) -> Result<Species, CommandError> {
    if Path::new(name).extension().is_some_and(|extension| extension == "safetensors") {
        let file = Path::new(name);
        return Species::from_bytes(&read(file)?).map_err(|error| CommandError::failed("species", &error).of(file));
    }
    let known = NAMES.join(", ");
    let found = match name.strip_prefix("generic:") {
        Some(name) => demeter_recon::species::generic(name),
        None => demeter_recon::species::shipped(name),
    };
    match found {
        Some(species) => species.map_err(|error| CommandError::failed("species", &error)),
        None => {
            let message = format!("--species: expected one of {known} or a .safetensors file, found `{name}`");
            Err(CommandError::usage("species", message).with(known, name))
        }
    }
}

/// The record in a file's `bytes` with its species: the one of `--species` where that is given, else the shipped one
/// that the record names.
///
/// # Errors
/// [`CommandError`] naming the record, and the species file that it needs when another one is at hand.
pub fn record(path: &Path, bytes: &[u8], species: Option<&str>) -> Result<(Record, Species), CommandError> {
    let refused = |error: RecordError| {
        let mut refused = CommandError::failed("record", &error).of(path);
        if let RecordError::Species { expected, found } = &error {
            refused.message += "; give the species file that it was written with by --species";
            return refused.with(expected, found);
        }
        refused
    };
    let wanted = record::peek(bytes).map_err(refused)?;
    let species = match species {
        Some(species) => self::species(species)?,
        None if NAMES.contains(&wanted.name.as_str()) => self::species(&wanted.name)?,
        None => {
            let found = format!("none of that name among those that ship ({})", NAMES.join(", "));
            return Err(refused(RecordError::Species { expected: wanted.to_string(), found }));
        }
    };
    Ok((record::decode(bytes, |_| Some(&species)).map_err(refused)?, species))
}

pub(crate) fn file_error(path: &Path, error: &std::io::Error) -> CommandError {
    let message = format!("{}: {error}", path.display());
    CommandError { exit: Exit::Failed, kind: "file", message, expected: None, found: None }
}
