//! Where a command's plant goes.

use std::path::PathBuf;

use demeter_recon::model::{Plant, Species};
use demeter_recon::organs::ScaleSource;

use crate::describe::{Encoding, report};
use crate::error::CommandError;
use crate::files;
use crate::report::PlantReport;

/// Arguments of every command that makes one plant.
#[derive(Debug, clap::Args)]
pub(super) struct Target {
    /// Where the record goes.
    #[arg(short, long)]
    output: PathBuf,
    /// Write the exact encoding instead of the compact one.
    #[arg(long)]
    exact: bool,
    /// Also write the plant's surface: .ply, .obj or .glb.
    #[arg(long)]
    mesh: Option<PathBuf>,
}

impl Target {
    pub(super) fn encoding(&self) -> Encoding {
        if self.exact { Encoding::Exact } else { Encoding::Compact }
    }

    /// Writes a record and the mesh of the plant that it holds; the report will name the record.
    pub(super) fn write(
        &self,
        record: &[u8],
        plant: &Plant,
        species: &Species,
        report: &mut PlantReport,
    ) -> Result<(), CommandError> {
        files::write(&self.output, record)?;
        report.record = Some(self.output.display().to_string());
        self.mesh.as_ref().map_or(Ok(()), |path| files::write_mesh(path, plant, species))
    }

    /// Encodes a plant, writes it, and gives the plant that its record holds with its report.
    pub(super) fn keep(
        &self,
        plant: &Plant,
        species: &Species,
        scale_source: ScaleSource,
    ) -> Result<(Plant, PlantReport), CommandError> {
        let (record, plant) = self.encoding().write(plant, species, scale_source)?;
        let mut report = report(&plant, species, record.len(), scale_source, &[])?;
        self.write(&record, &plant, species, &mut report)?;
        Ok((plant, report))
    }
}
