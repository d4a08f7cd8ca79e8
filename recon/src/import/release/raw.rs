//! A plant of the release in this model's kinematics, its joint angles raw: exact, where a basis can only be near.

use demeter_frame::Pose;
use glam::{DQuat, DVec2, DVec3};
use nalgebra::DVector;

use super::bases::Bases;
use super::decode::MIN_RADIUS;
use super::plant::{ReleaseForm, ReleasePlant};
use crate::fit::leaflets;
use crate::model::leaf::{self, Blade, BladeGrid, COLUMNS, ROWS, VEIN, node};
use crate::model::stem::{self, StemCurve};
use crate::model::{Form, Joint, Organ, Plant, PlantError, PosedPlant, Shape, Similarity, Species, articulate};
use crate::model::{leaf_angles, stem_angles};

/// Coefficients of the projection stay within this many σ, as everywhere in this model.
const MAX_SIGMA: f64 = 3.0;

/// An organ with its bones and joint angles.
#[derive(Clone, Debug)]
pub struct RawOrgan {
    /// Index of its parent, which stands before it.
    pub parent: Option<usize>,
    /// Attachment on the parent, 0..=1.
    pub d: f64,
    /// Rotation and size in the world; where it stands follows from its parent.
    pub world_from_organ: Similarity,
    /// Bones and angles.
    pub form: RawForm,
}

/// The form of a [`RawOrgan`], in its own frame and unit size.
#[derive(Clone, Debug)]
pub enum RawForm {
    /// A stem of path length 1.
    Stem {
        /// Lengths of its bones `[23]`.
        lengths: Vec<f64>,
        /// Joint angles `[46]`.
        angles: DVector<f64>,
        /// Radius.
        radius: f64,
    },
    /// A leaf whose flat grid goes from (0, 0) to (0, 1).
    Leaf {
        /// The flat grid `[45*43]`.
        flat: Vec<DVec2>,
        /// Joint angles `[3700]`.
        angles: DVector<f64>,
    },
}

impl RawForm {
    /// A stem through control points `[24]` in any frame, `radius` in their unit, and where it stands there.
    #[must_use]
    pub fn stem(points: &[DVec3], radius: f64) -> (Self, Similarity) {
        let lengths: Vec<f64> = points.windows(2).map(|p| p[0].distance(p[1])).collect();
        // A stem without length keeps its place; dividing by the smallest number leaves its points finite.
        let scale = lengths.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let (world, local) = gauged(points, stem::gauge(points), scale);
        let lengths = lengths.into_iter().map(|length| length / scale).collect();
        (Self::Stem { lengths, angles: stem_angles(&local), radius: radius / scale }, world)
    }

    /// A leaf with the bones of `flat` `[45*43]`, which is `scale` units of the points long per own unit, in the
    /// directions of `points` `[45*43]` in any frame.
    #[must_use]
    pub fn leaf(flat: &[DVec2], points: &[DVec3], scale: f64) -> (Self, Similarity) {
        let (flat, length) = unit(flat);
        let (world, local) = gauged(points, leaf::gauge(points), scale * length);
        let angles = leaf_angles(&flat, &local);
        (Self::Leaf { flat, angles }, world)
    }

    /// The organ's own geometry.
    #[must_use]
    pub fn shape(&self) -> Shape {
        match self {
            Self::Stem { lengths, angles, radius } => Shape::Stem(StemCurve::bent(lengths, angles), *radius),
            Self::Leaf { flat, angles } => Shape::Blade(BladeGrid::bent(flat, angles).points),
        }
    }

    /// The nearest form of a species, coefficients within 3 σ.
    fn project(&self, species: &Species) -> Form {
        let within = |c: Vec<f64>| c.into_iter().map(|c| c.clamp(-MAX_SIGMA, MAX_SIGMA)).collect();
        match self {
            Self::Stem { angles, radius, .. } => {
                Form::Stem { gamma: within(species.stem.deform.project(angles)), radius: *radius }
            }
            Self::Leaf { flat, angles } => {
                let xy = DVector::from_iterator(2 * flat.len(), flat.iter().flat_map(|p| [p.x, p.y]));
                let beta = within(species.leaf.shape.project(&xy));
                let gamma = within(species.leaf.deform.project(angles));
                Form::Leaf { blade: Blade { beta, gamma, width: 1.0 }, leaf: 0 }
            }
        }
    }
}

/// Points brought to gauge and unit size, and the way back.
fn gauged(points: &[DVec3], gauge: DQuat, scale: f64) -> (Similarity, Vec<DVec3>) {
    // The gauges look at differences from the first point, some with the base taken for the origin.
    let base = points[0];
    let world = Similarity { rotation: gauge.inverse(), translation: base, scale };
    (world, points.iter().map(|p| gauge * (*p - base) / scale).collect())
}

/// A flat grid turned and scaled so that its main vein goes from (0, 0) to (0, 1), the tip row one point; its length.
pub(super) fn unit(flat: &[DVec2]) -> (Vec<DVec2>, f64) {
    let (base, tip) = (flat[node(0, VEIN)], flat[node(ROWS - 1, VEIN)]);
    let length = base.distance(tip).max(f64::MIN_POSITIVE);
    // Complex division by the tip's direction, which goes to +y.
    let along = (tip - base) / length;
    let turn = DVec2::new(along.y, along.x);
    let row = |n: usize| {
        if n < COLUMNS {
            base
        } else if n >= node(ROWS - 1, 0) {
            tip
        } else {
            flat[n]
        }
    };
    ((0..leaf::POINTS).map(|n| turn.rotate(row(n) - base) / length).collect(), length)
}

/// A plant of [`RawOrgan`]s, parents before children.
#[derive(Clone, Debug)]
pub struct RawPlant {
    /// Its organs.
    pub organs: Vec<RawOrgan>,
}

impl RawPlant {
    /// A plant of the release as it decodes it.
    #[must_use]
    pub fn of(plant: &ReleasePlant, bases: &Bases) -> Self {
        let organs = plant.organs.iter().zip(plant.decode(bases)).map(|(organ, points)| {
            let (form, world_from_organ) = match &organ.form {
                ReleaseForm::Stem(radius) => RawForm::stem(&points, radius.max(MIN_RADIUS)),
                ReleaseForm::Leaf(beta) => RawForm::leaf(&bases.flat(beta), &points, organ.scale.abs()),
            };
            RawOrgan { parent: organ.parent, d: organ.d.clamp(0.0, 1.0), world_from_organ, form }
        });
        Self { organs: organs.collect() }
    }

    /// The plant posed by this model's kinematics.
    ///
    /// # Errors
    /// [`PlantError`] when parents do not stand before children or a leaf has one.
    pub fn pose(&self) -> Result<PosedPlant, PlantError> {
        let shapes: Vec<Shape> = self.organs.iter().map(|organ| organ.form.shape()).collect();
        let joints = self.joints(&shapes);
        let organs = self.organs.iter().zip(joints).zip(shapes);
        articulate(self.place(), organs.map(|((organ, joint), shape)| (organ.parent, joint, shape)))
    }

    /// The nearest plant of a species: every organ's coefficients by projection, within 3 σ, its rotation and size in
    /// the world kept, its foot on what its parent has become.
    #[must_use]
    pub fn project(&self, species: &Species) -> Plant {
        let forms: Vec<Form> = self.organs.iter().map(|organ| organ.form.project(species)).collect();
        let shapes: Vec<Shape> = forms.iter().map(|form| form.shape(species)).collect();
        let joints = self.joints(&shapes);
        let parts = self.organs.iter().zip(joints).zip(forms);
        let mut organs: Vec<Organ> =
            parts.map(|((organ, joint), form)| Organ { parent: organ.parent, joint, form }).collect();
        leaflets::group(&mut organs, species.habit);
        Plant { world_from_plant: self.place(), organs }
    }

    fn place(&self) -> Pose {
        Pose::new(DQuat::IDENTITY, self.organs.first().map_or(DVec3::ZERO, |stem| stem.world_from_organ.translation))
    }

    /// How each organ of these shapes hangs on its parent when it keeps its rotation and size in the world.
    fn joints(&self, shapes: &[Shape]) -> Vec<Joint> {
        let relative = |organ: &RawOrgan| {
            let Similarity { rotation, scale, .. } = organ.world_from_organ;
            let base = match organ.parent.map(|parent| (&self.organs[parent].world_from_organ, &shapes[parent])) {
                Some((world, Shape::Stem(curve, _))) => world.at(curve, organ.d),
                _ => Similarity { rotation: DQuat::IDENTITY, translation: DVec3::ZERO, scale: 1.0 },
            };
            let turn = (base.rotation.inverse() * rotation).normalize();
            let d = if organ.parent.is_some() { organ.d } else { 0.0 };
            Joint { d, rotation: if turn.w < 0.0 { -turn } else { turn }, scale: scale / base.scale }
        };
        self.organs.iter().map(relative).collect()
    }
}
