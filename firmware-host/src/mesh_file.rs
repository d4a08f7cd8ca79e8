//! A plant's mesh as a file.

use std::path::Path;

use demeter_recon::export::{mesh_to_glb, mesh_to_obj, mesh_to_ply};
use demeter_recon::model::{Detail, Knots, Organ, OrganKind, Plant, PlantError, PlantMesh, Species, forward};
use demeter_recon::record::{self, RecordError};

use crate::store::StoredRecord;

/// The mesh formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum MeshFormat {
    /// Binary PLY.
    Ply,
    /// Wavefront OBJ.
    Obj,
    /// glTF 2.0 binary.
    Glb,
}

/// Why a stored record has no mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The species file that was kept with the record is none.
    #[error(transparent)]
    Species(#[from] demeter_recon::model::species::SpeciesError),
    /// The record is none.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The plant cannot be posed.
    #[error(transparent)]
    Plant(#[from] PlantError),
}

impl MeshFormat {
    /// The format that a file's name asks for.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        [Self::Ply, Self::Obj, Self::Glb].into_iter().find(|format| format.extension().eq_ignore_ascii_case(extension))
    }

    /// How its files' names end, without the dot.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Glb => "glb",
        }
    }

    /// The file of a plant.
    ///
    /// # Errors
    /// [`PlantError`] when the plant is none.
    pub fn encode(self, plant: &Plant, species: &Species) -> Result<Vec<u8>, PlantError> {
        let mesh = PlantMesh::of(&forward(plant, species)?, Detail::Control, Knots::default());
        let kinds: Vec<OrganKind> = plant.organs.iter().map(Organ::kind).collect();
        Ok(match self {
            Self::Ply => mesh_to_ply(&mesh),
            Self::Obj => mesh_to_obj(&mesh, &kinds),
            Self::Glb => mesh_to_glb(&mesh, &kinds),
        })
    }

    /// The file of a stored plant, out of its record and the species file kept with it.
    ///
    /// # Errors
    /// [`MeshError`] when the store holds something else.
    pub fn encode_stored(self, stored: &StoredRecord) -> Result<Vec<u8>, MeshError> {
        let species = Species::from_bytes(&stored.species)?;
        let record = record::decode(&stored.record, |_| Some(&species))?;
        Ok(self.encode(&record.plant, &species)?)
    }
}
