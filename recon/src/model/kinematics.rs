//! Forward kinematics: one pass from the root to the tips (paper eq. 3).

use glam::{DQuat, DVec3};

use super::plant::{Form, Plant, PlantError};
use super::species::Species;
use super::stem::{BONES, StemCurve};

/// A rotation, uniform scaling and shift: `x_in_world = translation + scale * rotation * x_in_organ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Rotation.
    pub rotation: DQuat,
    /// Metres.
    pub translation: DVec3,
    /// Metres per organ unit, above 0.
    pub scale: f64,
}

impl Similarity {
    /// Maps a point of the organ's frame.
    #[must_use]
    pub fn point(&self, x_in_organ: DVec3) -> DVec3 {
        self.translation + self.rotation * (x_in_organ * self.scale)
    }
}

/// A stem's attachment frame at d: p(d) on the polyline, F(d) the slerp between the neighbouring control points'
/// frames (the paper keeps the preceding one; the slerp's derivative does not jump).
#[must_use]
pub fn attachment(curve: &StemCurve, d: f64) -> (DVec3, DQuat) {
    let at = d.clamp(0.0, 1.0) * BONES as f64;
    let i = (at.floor() as usize).min(BONES - 1);
    let t = at - i as f64;
    (curve.points[i].lerp(curve.points[i + 1], t), curve.frames[i].slerp(curve.frames[i + 1], t))
}

/// Every organ where it stands in the world.
#[derive(Clone, Debug)]
pub struct PosedPlant {
    /// world_from_organ of each organ.
    pub world_from_organ: Vec<Similarity>,
    /// Control points in the world: 24 of a stem, 45 x 43 of a blade.
    pub control: Vec<Vec<DVec3>>,
    /// Stem radius in metres, 0 for blades.
    pub radius: Vec<f64>,
    /// Unit direction across the base of each organ from which a stem's tube begins its rings: +x of the unbent
    /// stem, before the gauge, which turns at the slightest change of a nearly straight stem.
    pub side: Vec<DVec3>,
}

/// Poses a plant.
///
/// # Errors
/// [`PlantError`] when the plant is none (see [`Plant::validate`]).
pub fn forward(plant: &Plant, species: &Species) -> Result<PosedPlant, PlantError> {
    plant.validate()?;
    let count = plant.organs.len();
    let mut curves: Vec<Option<StemCurve>> = Vec::with_capacity(count);
    let mut posed = PosedPlant {
        world_from_organ: Vec::with_capacity(count),
        control: Vec::with_capacity(count),
        radius: Vec::with_capacity(count),
        side: Vec::with_capacity(count),
    };
    for organ in &plant.organs {
        let base = match organ.parent {
            None => Similarity {
                rotation: plant.world_from_plant.rotation,
                translation: plant.world_from_plant.translation,
                scale: 1.0,
            },
            Some(parent) => {
                let world_from_parent: Similarity = posed.world_from_organ[parent];
                let (p, frame) = match &curves[parent] {
                    Some(curve) => attachment(curve, organ.joint.d),
                    None => return Err(PlantError::LeafParent { organ: posed.control.len(), parent }),
                };
                Similarity {
                    rotation: world_from_parent.rotation * frame,
                    translation: world_from_parent.point(p),
                    scale: world_from_parent.scale,
                }
            }
        };
        let world_from_organ = Similarity {
            rotation: (base.rotation * organ.joint.rotation).normalize(),
            translation: base.translation,
            scale: base.scale * organ.joint.scale,
        };
        let (points, curve, radius) = match &organ.form {
            Form::Stem { gamma, radius } => {
                let curve = species.stem.curve(gamma);
                (curve.points.clone(), Some(curve), radius * world_from_organ.scale)
            }
            Form::Leaf { blade, .. } => (species.leaf.grid(blade).points, None, 0.0),
        };
        posed.control.push(points.into_iter().map(|p| world_from_organ.point(p)).collect());
        posed.radius.push(radius);
        let unbent = curve.as_ref().map_or(DQuat::IDENTITY, |curve| curve.frames[0]);
        posed.side.push(world_from_organ.rotation * (unbent * DVec3::X));
        posed.world_from_organ.push(world_from_organ);
        curves.push(curve);
    }
    Ok(posed)
}
