//! From a fitted plant to what is kept and told of it: its compact record, and the report of the plant that decodes
//! from that record, never of the raw fit.

use demeter_recon::fit::{Fitted, OrganFit};
use demeter_recon::metrics::chamfer;
use demeter_recon::model::{Detail, Form, Knots, Plant, PlantMesh, Species, forward};
use demeter_recon::organs::ScaleSource;
use demeter_recon::record::{decode, encode_compact};
use demeter_recon::traits::PlantTraits;
use glam::DVec3;

use crate::error::CommandError;
use crate::report::{OrganReport, PlantReport};

/// A fitted plant, encoded, decoded and measured.
pub struct Described {
    /// The compact record.
    pub record: Vec<u8>,
    /// The plant that the record holds.
    pub plant: Plant,
    /// Its surface at control-point detail.
    pub mesh: PlantMesh,
    /// What is told of it.
    pub report: PlantReport,
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
) -> Result<Described, CommandError> {
    let failed = |error: &dyn std::error::Error| CommandError::failed("record", error);
    let record = encode_compact(&fitted.plant, species, scale_source).map_err(|error| failed(&error))?;
    let plant = decode(&record, |_| Some(species)).map_err(|error| failed(&error))?.plant;
    let posed = forward(&plant, species).map_err(|error| failed(&error))?;
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
