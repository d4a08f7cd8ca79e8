//! The stem: 24 control points, 23 unit-path bones bent by joint angles (spec/demeter-model.md "Deformation").

use glam::{DQuat, DVec3};
use nalgebra::DVector;

use super::basis::Basis;
use super::chain::{Change, Joint};
use super::leaf::frame_of;

/// Control points of a stem.
pub const POINTS: usize = 24;
/// Bones of a stem; each is 1/23 long, so the path length is 1.
pub const BONES: usize = POINTS - 1;
/// Lengths of the bones in stems' unit of path length.
const BONE_LENGTHS: [f64; BONES] = [1.0 / BONES as f64; BONES];
/// Joint angles: (a, b) of each bone, interleaved.
pub const ANGLES: usize = 2 * BONES;

/// What a species knows of its stems.
#[derive(Clone, Debug, PartialEq)]
pub struct StemModel {
    /// Joint angles `[46]`: a_1, b_1, a_2, ...
    pub deform: Basis,
}

/// A stem's gauged control points: base at the origin, end on +y.
#[derive(Clone, Debug)]
pub struct StemCurve {
    /// `[24]`.
    pub points: Vec<DVec3>,
    /// Frame of each control point, gauged; frame i is that of the bone arriving at i, frame 0 that before bone 1.
    pub frames: Vec<DQuat>,
}

/// The raw chain with its derivatives by γ: the fitting form.
#[derive(Clone, Debug)]
pub struct StemJacobian {
    /// `[24]`, base at the origin.
    pub points: Vec<DVec3>,
    /// `[24][K]` flattened.
    pub derivatives: Vec<DVec3>,
    /// K.
    pub coefficients: usize,
}

impl StemModel {
    /// The gauged curve of γ.
    #[must_use]
    pub fn curve(&self, gamma: &[f64]) -> StemCurve {
        StemCurve::bent(&BONE_LENGTHS, &self.deform.at(gamma))
    }

    /// The raw (ungauged) control points and their analytic derivatives by γ.
    #[must_use]
    pub fn jacobian(&self, gamma: &[f64]) -> StemJacobian {
        let coefficients = self.deform.rank();
        let angles = self.deform.at(gamma);
        let (points, _, derivatives) = chain(&BONE_LENGTHS, &angles, coefficients, |q| Change {
            angles: [self.deform.derivative(q), self.deform.derivative(q + 1)],
            ..Change::default()
        });
        StemJacobian { points, derivatives, coefficients }
    }
}

impl StemCurve {
    /// A straight stem of bones with these lengths `[23]`, along +y, bent by joint angles `[46]`.
    #[must_use]
    pub fn bent(lengths: &[f64], angles: &DVector<f64>) -> Self {
        let (raw, frames, _) = chain(lengths, angles, 0, |_| Change::default());
        let gauge = gauge(&raw);
        Self {
            points: raw.iter().map(|p| gauge * *p).collect(),
            frames: frames.iter().map(|f| (gauge * *f).normalize()).collect(),
        }
    }
}

/// Control points, frames and derivatives by `coefficients` angle coefficients; `change` gives those of the bone whose
/// first angle has that index.
fn chain<'a>(
    lengths: &[f64],
    angles: &DVector<f64>,
    coefficients: usize,
    change: impl Fn(usize) -> Change<'a>,
) -> (Vec<DVec3>, Vec<DQuat>, Vec<DVec3>) {
    let mut joint = Joint::at_origin(coefficients, 0);
    let (mut points, mut frames) = (vec![joint.point], vec![DQuat::IDENTITY]);
    let mut derivatives = vec![DVec3::ZERO; coefficients];
    for (bone, length) in lengths.iter().enumerate() {
        let q = 2 * bone;
        joint.advance([DVec3::X, DVec3::Z], [angles[q], angles[q + 1]], DVec3::Y * *length, change(q));
        points.push(joint.point);
        frames.push(DQuat::from_mat3(&joint.frame).normalize());
        let [x, y, z] = [0, 1, 2].map(|axis| joint.velocity(axis).0);
        derivatives.extend((0..coefficients).map(|k| DVec3::new(x[k], y[k], z[k])));
    }
    (points, frames, derivatives)
}

/// The rotation that brings a bent stem (base at the origin) to its gauge: end on +y, centroid of the control points
/// in the half-plane x = 0, z <= 0; the roll of a straight stem is kept.
#[must_use]
pub fn gauge(points: &[DVec3]) -> DQuat {
    let chord = points[points.len() - 1] - points[0];
    let y = chord.normalize_or(DVec3::Y);
    let centroid = points.iter().copied().sum::<DVec3>() / points.len() as f64 - points[0];
    let bow = centroid.reject_from_normalized(y);
    // A bow under a ten-thousandth of the path has no direction worth keeping.
    if bow.length() < 1e-4 {
        return DQuat::from_rotation_arc(y, DVec3::Y);
    }
    // The bow goes to -z, so +x = y × z = bow-normal.
    frame_of(y, y.cross(-bow))
}
