//! From a fitted plant to what is kept and told of it: its record, and the report of the plant that decodes from that
//! record, never of the raw fit.

use demeter_recon::fit::{Fitted, OrganFit};
use demeter_recon::metrics::chamfer;
use demeter_recon::model::{Detail, Form, Knots, Plant, PlantMesh, Species, forward};
use demeter_recon::organs::ScaleSource;
use demeter_recon::record::{RecordError, decode, encode_compact, encode_exact};
use demeter_recon::traits::PlantTraits;
use glam::DVec3;

use crate::error::CommandError;
use crate::report::{OrganReport, PlantReport};

/// A fitted plant, encoded, decoded and measured.
pub struct Described {
    /// The record.
    pub record: Vec<u8>,
    /// The plant that the record holds.
    pub plant: Plant,
    /// Its surface at control-point detail.
    pub mesh: PlantMesh,
    /// What is told of it.
    pub report: PlantReport,
}

/// How a record is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Quantised and entropy-coded.
    Compact,
    /// All that the plant holds, to f32.
    Exact,
}

impl Encoding {
    /// A plant's record, and the plant that it holds: what is told of a record is told of that one.
    ///
    /// # Errors
    /// [`CommandError`] `record` when the plant has no record.
    pub fn write(
        self,
        plant: &Plant,
        species: &Species,
        scale_source: ScaleSource,
    ) -> Result<(Vec<u8>, Plant), CommandError> {
        let failed = |error: RecordError| CommandError::failed("record", &error);
        let encode = match self {
            Self::Compact => encode_compact,
            Self::Exact => encode_exact,
        };
        let bytes = encode(plant, species, scale_source).map_err(failed)?;
        let plant = decode(&bytes, |_| Some(species)).map_err(failed)?.plant;
        Ok((bytes, plant))
    }
}

/// Encodes a fitted plant, decodes it again and reports on what came back. `cloud` holds the points it was fitted
/// to, in the plant's world frame.
///
/// # Errors
/// [`CommandError`] `record` when the plant cannot be encoded.
pub fn describe(
    fitted: &Fitted,
    species: &Species,
    cloud: &[DVec3],
    scale_source: ScaleSource,
    encoding: Encoding,
) -> Result<Described, CommandError> {
    let (record, plant) = encoding.write(&fitted.plant, species, scale_source)?;
    let posed = forward(&plant, species).map_err(|error| CommandError::failed("record", &error))?;
    let mesh = PlantMesh::of(&posed, Detail::Control, Knots::Uniform);
    let mut report = report(&plant, species, record.len(), scale_source, &fitted.organs)?;
    report.cd = chamfer(cloud, &mesh).map(|chamfer| chamfer.cd);
    for (organ, fit) in report.organs.iter_mut().zip(&fitted.organs) {
        organ.points = Some(fit.points);
        organ.residual = fit.residual;
        organ.visible_fraction = fit.visible_fraction;
    }
    report.warnings.extend(fitted.dropped.iter().map(|reason| format!("left out {reason}")));
    Ok(Described { record, plant, mesh, report })
}

/// Reports on a decoded plant. What its fit knew is not in a record; `fits` is empty when it is not at hand.
///
/// # Errors
/// [`CommandError`] `record` when the plant is none.
pub fn report(
    plant: &Plant,
    species: &Species,
    bytes: usize,
    scale_source: ScaleSource,
    fits: &[OrganFit],
) -> Result<PlantReport, CommandError> {
    let mut traits =
        PlantTraits::of(plant, species, scale_source).map_err(|error| CommandError::failed("record", &error))?;
    if !fits.is_empty() {
        traits.take_up(fits);
    }
    let PlantTraits { plant: whole, organs: each } = traits;
    let organs = plant.organs.iter().zip(each).enumerate().map(|(id, (organ, traits))| OrganReport {
        id,
        kind: organ.kind().into(),
        parent: organ.parent,
        leaf: match organ.form {
            Form::Leaf { leaf, .. } => Some(leaf),
            Form::Stem { .. } => None,
        },
        points: None,
        residual: None,
        visible_fraction: None,
        traits,
    });
    Ok(PlantReport {
        id: None,
        species: species.name.clone(),
        species_hash: Some(species.hash().to_owned()),
        organs: organs.collect(),
        traits: whole,
        cd: None,
        bytes,
        scale_source,
        record: None,
        camera: None,
        warnings: Vec::new(),
        ms: None,
    })
}
