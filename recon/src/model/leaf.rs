//! The leaf: a flat grid shaped by β, bent by joint angles γ (paper 3.1, eq. 4 and 5).

use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::DVector;

use super::basis::Basis;
use super::chain::Joint;

/// Rows of the control grid along the main vein, base (0) to tip (44): m_l1.
pub const ROWS: usize = 45;
/// Columns across the main vein, left edge (0) to right edge (42): m_l2.
pub const COLUMNS: usize = 43;
/// The column of the main vein.
pub const VEIN: usize = 21;
/// Control points of a leaf.
pub const POINTS: usize = ROWS * COLUMNS;
/// Joint angles of a leaf: 44 bones of the main vein and 2 x 21 of each inner row, two angles each.
pub const ANGLES: usize = 2 * (ROWS - 1) + 2 * 2 * VEIN * (ROWS - 2);

/// Index of grid node (row, column) in row-major storage.
#[must_use]
pub const fn node(row: usize, column: usize) -> usize {
    row * COLUMNS + column
}

/// Index of the first of the two angles (a, b) of the main vein's bone arriving at `row` (1..=44).
#[must_use]
pub const fn vein_angle(row: usize) -> usize {
    2 * (row - 1)
}

/// Index of the first of the two angles (c, e) of side bone `k` (1..=21) of `row` (1..=43) on a side.
#[must_use]
pub const fn side_angle(row: usize, side: Side, k: usize) -> usize {
    let side = match side {
        Side::Left => 0,
        Side::Right => 1,
    };
    2 * (ROWS - 1) + (((row - 1) * 2 + side) * VEIN + (k - 1)) * 2
}

/// Which half of the blade, seen from above with the tip ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Columns 20 down to 0, x < 0.
    Left,
    /// Columns 22 up to 42, x > 0.
    Right,
}

impl Side {
    /// Both sides.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// Column of side bone `k`'s end; k = 0 is the main vein.
    #[must_use]
    pub const fn column(self, k: usize) -> usize {
        match self {
            Self::Left => VEIN - k,
            Self::Right => VEIN + k,
        }
    }
}

/// What a species knows of its leaves.
#[derive(Clone, Debug, PartialEq)]
pub struct LeafModel {
    /// Flat grid: outputs are (x, y) of each node, interleaved, row-major `[45*43*2]`; base (0,0), tip (0,1).
    pub shape: Basis,
    /// Joint angles `[3700]`, laid out by [`vein_angle`] and [`side_angle`].
    pub deform: Basis,
}

/// The parameters of one blade in its own frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Blade {
    /// Shape coefficients in σ.
    pub beta: Vec<f64>,
    /// Deformation coefficients in σ.
    pub gamma: Vec<f64>,
    /// Cross-vein scaling s_x of grasses (x <- s_x x); 1 elsewhere.
    pub width: f64,
}

/// A blade's control grid, gauged: base at the origin, tip on +y, roll zero.
#[derive(Clone, Debug)]
pub struct BladeGrid {
    /// `[45*43]` row-major.
    pub points: Vec<DVec3>,
    /// The rotation that the gauge applied to the raw chain (organ_from_chain).
    pub gauge: DQuat,
}

/// The raw chain's control grid with its derivatives: the fitting form, before the gauge.
#[derive(Clone, Debug)]
pub struct BladeJacobian {
    /// `[45*43]` row-major, base at the origin, first bone's rest frame the identity.
    pub points: Vec<DVec3>,
    /// Derivatives of each point by β, then γ, then ln(width): `[45*43][K]` flattened.
    pub derivatives: Vec<DVec3>,
    /// K.
    pub coefficients: usize,
}

impl LeafModel {
    /// The flat leaf of β and s_x: (x, y) of each node.
    #[must_use]
    pub fn flat(&self, beta: &[f64], width: f64) -> Vec<DVec2> {
        let xy = self.shape.at(beta);
        xy.as_slice().chunks_exact(2).map(|p| DVec2::new(p[0] * width, p[1])).collect()
    }

    /// The blade's gauged control grid.
    #[must_use]
    pub fn grid(&self, blade: &Blade) -> BladeGrid {
        let flat = self.flat(&blade.beta, blade.width);
        let raw = bend(&flat, &self.deform.at(&blade.gamma), (0, 0), |_, _| DVec2::ZERO, |_, _| 0.0).0;
        let gauge = gauge(&raw);
        BladeGrid { points: raw.iter().map(|p| gauge * *p).collect(), gauge }
    }

    /// The raw (ungauged) grid and its analytic derivatives by β, γ and ln s_x.
    #[must_use]
    pub fn jacobian(&self, blade: &Blade) -> BladeJacobian {
        let (shapes, bends) = (self.shape.rank(), self.deform.rank());
        let coefficients = shapes + bends + 1;
        let flat = self.flat(&blade.beta, blade.width);
        let angles = self.deform.at(&blade.gamma);
        let dflat = |n: usize, k: usize| {
            if k < shapes {
                DVec2::new(self.shape.derivative(2 * n)[k] * blade.width, self.shape.derivative(2 * n + 1)[k])
            } else {
                DVec2::new(flat[n].x, 0.0)
            }
        };
        let dangle = |index: usize, k: usize| self.deform.derivative(index)[k];
        let (points, derivatives) = bend(&flat, &angles, (shapes + 1, bends), dflat, dangle);
        BladeJacobian { points, derivatives, coefficients }
    }
}

/// Bends a flat grid: the main vein as one chain, each inner row as two chains that leave it (paper eq. 5).
///
/// `coefficients` counts those that change the flat grid (β, then ln s_x; `dflat` by node and coefficient) and those
/// that change angles (γ; `dangle` by angle and coefficient). Returns points and their derivatives
/// `[45*43][β, γ, ln s_x]`; with no coefficients there are none.
fn bend(
    flat: &[DVec2],
    angles: &DVector<f64>,
    coefficients: (usize, usize),
    dflat: impl Fn(usize, usize) -> DVec2,
    dangle: impl Fn(usize, usize) -> f64,
) -> (Vec<DVec3>, Vec<DVec3>) {
    let (slides, swings) = coefficients;
    let mut points = vec![DVec3::ZERO; POINTS];
    let mut derivatives = vec![DVec3::ZERO; POINTS * (slides + swings)];
    let mut put = |n: usize, joint: &Joint| {
        points[n] = joint.point;
        let (shapes, width) = joint.slide.split_at(slides.saturating_sub(1));
        let bends = joint.swing.iter().map(|(_, velocity)| velocity);
        let cells = &mut derivatives[n * (slides + swings)..(n + 1) * (slides + swings)];
        for (cell, velocity) in cells.iter_mut().zip(shapes.iter().chain(bends).chain(width)) {
            *cell = *velocity;
        }
    };
    let bone = |to: usize, from: usize| (flat[to] - flat[from]).extend(0.0);
    let mut vein = Joint::at_origin(slides, swings);
    let mut rib = vein.clone();
    for j in 0..COLUMNS {
        put(node(0, j), &vein);
    }
    for i in 1..ROWS {
        let (to, from, q) = (node(i, VEIN), node(i - 1, VEIN), vein_angle(i));
        vein.advance(
            DVec3::new(angles[q], 0.0, angles[q + 1]),
            bone(to, from),
            |k| (dflat(to, k) - dflat(from, k)).extend(0.0),
            |k| DVec3::new(dangle(q, k), 0.0, dangle(q + 1, k)),
        );
        put(to, &vein);
        if i == ROWS - 1 {
            // The tip row is one point.
            for j in 0..COLUMNS {
                put(node(i, j), &vein);
            }
            break;
        }
        for side in Side::BOTH {
            rib.clone_from(&vein);
            for k in 1..=VEIN {
                let (to, from, q) = (node(i, side.column(k)), node(i, side.column(k - 1)), side_angle(i, side, k));
                rib.advance(
                    DVec3::new(0.0, angles[q], angles[q + 1]),
                    bone(to, from),
                    |m| (dflat(to, m) - dflat(from, m)).extend(0.0),
                    |m| DVec3::new(0.0, dangle(q, m), dangle(q + 1, m)),
                );
                put(to, &rib);
            }
        }
    }
    (points, derivatives)
}

/// The rotation that brings a bent grid (base at the origin) to the gauge of spec/demeter-model.md: tip on +y, mean
/// side-vein chord (right minus left) in the half-plane z = 0, x > 0.
#[must_use]
pub fn gauge(points: &[DVec3]) -> DQuat {
    let chord = points[node(ROWS - 1, VEIN)] - points[node(0, VEIN)];
    let across: DVec3 = (1..ROWS - 1).map(|i| points[node(i, COLUMNS - 1)] - points[node(i, 0)]).sum();
    frame_of(chord, across)
}

/// The rotation taking `along` to +y and `across`, made orthogonal to it, to +x; degenerate directions are replaced
/// by any orthogonal one, so the result is always a rotation.
pub(crate) fn frame_of(along: DVec3, across: DVec3) -> DQuat {
    let y = along.normalize_or(DVec3::Y);
    let x = across.reject_from_normalized(y).normalize_or(y.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).inverse()
}
