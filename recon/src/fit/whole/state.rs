//! The plant while stage 2 moves it. An organ's parameters are its place (3), d, turn (3; rotation vector in the world),
//! ln length and, of a stem, γ and ln radius.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use super::elimination::{D, PLACE, TURN};
use super::rigid::Rigid;
use crate::fit::solver::Normal;
use crate::fit::tube::{Rows, Tube};
use crate::model::Species;
use crate::model::stem::BONES;

/// What an organ is, in the world.
#[derive(Clone, Debug)]
pub(super) enum Body {
    Tube(Tube),
    Rigid(Rigid),
}

/// One organ.
#[derive(Clone, Debug)]
pub(super) struct Member {
    /// The stem that carries it, before it in the list.
    pub parent: Option<usize>,
    /// Fraction of that stem's path, 0..=1.
    pub d: f64,
    pub body: Body,
}

impl Member {
    pub(super) fn base(&self) -> DVec3 {
        match &self.body {
            Body::Tube(tube) => tube.base,
            Body::Rigid(blade) => blade.base,
        }
    }

    fn set_base(&mut self, base: DVec3) {
        match &mut self.body {
            Body::Tube(tube) => tube.base = base,
            Body::Rigid(blade) => blade.base = base,
        }
    }
}

/// Bone and fraction of it at d.
fn station(d: f64) -> (usize, f64) {
    let at = d.clamp(0.0, 1.0) * BONES as f64;
    let bone = (at as usize).min(BONES - 1);
    (bone, at - bone as f64)
}

/// How an organ's place moves with its parent, and with its own d.
pub(super) struct Carried {
    /// 3 rows over the parent's (place, own parameters).
    pub carry: DMatrix<f64>,
    /// Metres by d.
    pub tangent: DVec3,
}

/// How a place at `d` of a stem moves; `tangent` is that of the stem's own place by its own d.
pub(super) fn carried(rows: &mut Rows<'_>, tangent: DVec3, d: f64) -> Carried {
    let (bone, t) = station(d);
    let by_axis = DVec3::AXES.map(|axis| with_d(rows.gradient(bone, t, axis), tangent));
    let columns = by_axis[0].len();
    let carry = DMatrix::from_fn(PLACE, columns, |axis, column| by_axis[axis][column]);
    Carried { carry, tangent: (rows.axis[bone + 1] - rows.axis[bone]) * BONES as f64 }
}

/// A gradient over base, turn, ... as one over place, d, turn, ...: d moves the base along `tangent`.
fn with_d(gradient: &[f64], tangent: DVec3) -> Vec<f64> {
    let (base, rest) = gradient.split_at(PLACE);
    [base, &[tangent.dot(DVec3::from_slice(base))], rest].concat()
}

/// An organ's normal equations over base, turn, ... as symmetric ones over place, d, turn, ...
pub(super) fn over_place_and_d(mut normal: Normal, tangent: DVec3) -> (DMatrix<f64>, DVector<f64>) {
    normal.h.fill_lower_triangle_with_upper_triangle();
    let n = normal.g.len();
    // Rows: the old columns by the new.
    let mut map = DMatrix::zeros(n, n + 1);
    for column in 0..n {
        map[(column, if column < PLACE { column } else { column + 1 })] = 1.0;
    }
    for axis in 0..PLACE {
        map[(axis, D)] = tangent[axis];
    }
    (map.transpose() * normal.h * &map, map.transpose() * normal.g)
}

/// The plant after a step of each organ's (place, d, turn, ln length, ...): every organ hangs exactly on its parent.
pub(super) fn stepped(members: &[Member], steps: &[DVector<f64>], species: &Species) -> Vec<Member> {
    let mut moved: Vec<Member> = Vec::with_capacity(members.len());
    // Control points of the stems that have moved already.
    let mut axes: Vec<Vec<DVec3>> = Vec::with_capacity(members.len());
    for (member, step) in members.iter().zip(steps) {
        let step = step.as_slice();
        let body = match &member.body {
            Body::Tube(tube) => Body::Tube(tube.stepped(&step[TURN..], &species.ranges)),
            Body::Rigid(blade) => Body::Rigid(blade.stepped(&step[TURN..], &species.ranges)),
        };
        let mut next = Member { parent: member.parent, d: (member.d + step[D]).clamp(0.0, 1.0), body };
        next.set_base(match member.parent {
            Some(parent) => {
                let (bone, t) = station(next.d);
                axes[parent][bone].lerp(axes[parent][bone + 1], t)
            }
            None => member.base() + DVec3::from_slice(step),
        });
        axes.push(match &next.body {
            Body::Tube(tube) => Rows::of(tube, species).axis,
            Body::Rigid(_) => Vec::new(),
        });
        moved.push(next);
    }
    moved
}
