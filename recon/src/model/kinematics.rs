//! Forward kinematics: one pass from the root to the tips (paper eq. 3).

use demeter_frame::Pose;
use glam::{DQuat, DVec3};

use super::plant::{Form, Joint, Plant, PlantError};
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

    /// The frame in which this stem's children at d hang, the stem's curve being `curve`.
    #[must_use]
    pub fn at(&self, curve: &StemCurve, d: f64) -> Self {
        let (p, frame) = attachment(curve, d);
        Self { rotation: self.rotation * frame, translation: self.point(p), scale: self.scale }
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

/// An organ's own geometry, in its own frame and unit size, whatever it was made from.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A stem's curve and its radius in units of the stem.
    Stem(StemCurve, f64),
    /// A blade's control points.
    Blade(Vec<DVec3>),
}

impl Form {
    /// The form's geometry in a species.
    #[must_use]
    pub fn shape(&self, species: &Species) -> Shape {
        match self {
            Self::Stem { gamma, radius } => Shape::Stem(species.stem.curve(gamma), *radius),
            Self::Leaf { blade, .. } => Shape::Blade(species.leaf.grid(blade).points),
        }
    }
}

/// Poses a plant.
///
/// # Errors
/// [`PlantError`] when the plant is none (see [`Plant::validate`]).
pub fn forward(plant: &Plant, species: &Species) -> Result<PosedPlant, PlantError> {
    plant.validate()?;
    articulate(
        plant.world_from_plant,
        plant.organs.iter().map(|organ| (organ.parent, organ.joint, organ.form.shape(species))),
    )
}

/// Hangs organs on each other, parents before children: `(parent, joint, shape)` of each.
///
/// # Errors
/// [`PlantError`] when an organ hangs on a leaf or on one that does not stand before it.
pub fn articulate(
    world_from_plant: Pose,
    organs: impl Iterator<Item = (Option<usize>, Joint, Shape)>,
) -> Result<PosedPlant, PlantError> {
    let mut shapes: Vec<Shape> = Vec::new();
    let mut posed =
        PosedPlant { world_from_organ: Vec::new(), control: Vec::new(), radius: Vec::new(), side: Vec::new() };
    for (organ, (parent, joint, shape)) in organs.enumerate() {
        let base = match parent {
            None => Similarity {
                rotation: world_from_plant.rotation,
                translation: world_from_plant.translation,
                scale: 1.0,
            },
            Some(parent) => match shapes.get(parent) {
                Some(Shape::Stem(curve, _)) => posed.world_from_organ[parent].at(curve, joint.d),
                Some(Shape::Blade(_)) => return Err(PlantError::LeafParent { organ, parent }),
                None => return Err(PlantError::Parent { organ, found: parent }),
            },
        };
        let world_from_organ = Similarity {
            rotation: (base.rotation * joint.rotation).normalize(),
            translation: base.translation,
            scale: base.scale * joint.scale,
        };
        let (points, radius, unbent) = match &shape {
            Shape::Stem(curve, radius) => (&curve.points, radius * world_from_organ.scale, curve.frames[0]),
            Shape::Blade(points) => (points, 0.0, DQuat::IDENTITY),
        };
        posed.control.push(points.iter().map(|p| world_from_organ.point(*p)).collect());
        posed.radius.push(radius);
        posed.side.push(world_from_organ.rotation * (unbent * DVec3::X));
        posed.world_from_organ.push(world_from_organ);
        shapes.push(shape);
    }
    Ok(posed)
}
