//! What training pictures are made of, from a folder that tools/helios/meshes.py wrote.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use demeter_recon::species::NAMES;
use demeter_recon::world::{LabelledMesh, Nursery, Texture};
use image::{ImageFormat, ImageReader};

use crate::error::CommandError;
use crate::files;

/// Kinds of generated plants with strap leaves.
const GRASSES: [&str; 4] = ["maize", "sorghum", "wheat", "rice"];

/// Every species of ours, two of them also as they were before anything was learned, and the folder's plants and leaf
/// pictures where one is given.
///
/// # Errors
/// [`CommandError`] naming the file that cannot be read or holds no plant or picture.
pub(super) fn nursery(folder: Option<&Path>) -> Result<Nursery, CommandError> {
    let names = NAMES.iter().map(|name| (*name).to_owned());
    let generic = ["generic:soybean", "generic:maize"].map(str::to_owned);
    let mut nursery = Nursery::new(names.chain(generic).map(|name| files::species(&name)).collect::<Result<_, _>>()?);
    let Some(folder) = folder else {
        return Ok(nursery);
    };
    let mut textures = BTreeMap::new();
    for path in listed(&folder.join("textures"))? {
        textures.insert(name_of(&path), Arc::new(texture(&path)?));
    }
    for path in listed(&folder.join("blades"))? {
        nursery.add_blade(name_of(&path).starts_with("grass"), texture(&path)?);
    }
    for path in listed(&folder.join("plants"))? {
        let refused = |error| CommandError::failed("mesh", &error).of(&path);
        let mesh =
            LabelledMesh::from_bytes(&files::read(&path)?, |name| textures.get(name).cloned()).map_err(refused)?;
        let name = name_of(&path);
        let kind = name.split('_').next().unwrap_or_default();
        nursery.add_mesh(kind, GRASSES.contains(&kind), mesh);
    }
    Ok(nursery)
}

/// What the folder says of its making.
///
/// # Errors
/// [`CommandError`] naming its meta.json when that is missing: then the folder is not complete.
pub(super) fn made(folder: &Path) -> Result<serde_json::Value, CommandError> {
    let path = folder.join("meta.json");
    serde_json::from_slice(&files::read(&path)?).map_err(|error| CommandError::failed("assets", &error).of(&path))
}

/// The files of a folder in order of their names; those still being written are left out.
fn listed(folder: &Path) -> Result<Vec<PathBuf>, CommandError> {
    let failed = |error: std::io::Error| CommandError::failed("file", &error).of(folder);
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    let mut paths = entries.map(|entry| entry.map(|e| e.path())).collect::<Result<Vec<_>, _>>().map_err(failed)?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension != "part"));
    paths.sort();
    Ok(paths)
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn texture(path: &Path) -> Result<Texture, CommandError> {
    let picture = ImageReader::with_format(Cursor::new(files::read(path)?), ImageFormat::Png)
        .decode()
        .map_err(|error| CommandError::failed("texture", &error).of(path))?;
    let empty = || std::io::Error::other("expected a leaf, found no solid pixel");
    Texture::new(&picture.to_rgba8()).ok_or_else(|| CommandError::failed("texture", &empty()).of(path))
}
