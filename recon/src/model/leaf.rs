//! The leaf: a flat grid shaped by β, bent by joint angles γ (paper 3.1, eq. 4 and 5).

use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::DVector;

use super::basis::Basis;
use super::chain::{Change, Joint};

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

/// Every so many rows and columns of the control grid; edges, base, tip and main vein always belong to it. The rows of
/// side veins are chains of their own, so those that are left out cost nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lattice {
    along: usize,
    across: usize,
}

impl Lattice {
    /// The whole control grid.
    pub const WHOLE: Self = Self::every(1, 1);

    /// Every `along`-th row and `across`-th column.
    ///
    /// # Panics
    /// When `along` does not divide 44 or `across` does not divide 21; in a constant that is an error of the compiler.
    #[must_use]
    pub const fn every(along: usize, across: usize) -> Self {
        assert!((ROWS - 1).is_multiple_of(along) && VEIN.is_multiple_of(across));
        Self { along, across }
    }

    /// Rows, base and tip included.
    #[must_use]
    pub const fn rows(self) -> usize {
        (ROWS - 1) / self.along + 1
    }

    /// Columns, both edges included; the main vein is the middle one.
    #[must_use]
    pub const fn columns(self) -> usize {
        2 * (VEIN / self.across) + 1
    }

    /// Index of its node (row, column) in row-major storage.
    #[must_use]
    pub const fn node(self, row: usize, column: usize) -> usize {
        row * self.columns() + column
    }

    /// How many nodes it has.
    #[must_use]
    pub const fn len(self) -> usize {
        self.rows() * self.columns()
    }

    /// Never true: base and tip always belong to it.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        false
    }
}

/// The raw chain's control points with their derivatives: the fitting form, before the gauge.
#[derive(Clone, Debug)]
pub struct BladeJacobian {
    /// The lattice's nodes, row-major; base at the origin, first bone's rest frame the identity.
    pub points: Vec<DVec3>,
    /// `[node][x, y, z][K]`.
    derivatives: Vec<f64>,
    /// K: the numbers of β and of γ, and one for ln(width).
    pub coefficients: usize,
}

impl BladeJacobian {
    /// Derivatives of a point's x, y and z by β, then γ, then ln(width): K numbers each.
    #[must_use]
    pub fn axes(&self, node: usize) -> [&[f64]; 3] {
        let k = self.coefficients;
        [0, 1, 2].map(|axis| &self.derivatives[(3 * node + axis) * k..(3 * node + axis + 1) * k])
    }

    /// Derivative of a point by coefficient `k`.
    #[must_use]
    pub fn derivative(&self, node: usize, k: usize) -> DVec3 {
        DVec3::from_array(self.axes(node).map(|axis| axis[k]))
    }
}

impl BladeGrid {
    /// A flat grid `[45*43]` bent by joint angles `[3700]`.
    #[must_use]
    pub fn bent(flat: &[DVec2], angles: &DVector<f64>) -> Self {
        let mut points = vec![DVec3::ZERO; POINTS];
        walk(
            Lattice::WHOLE,
            &Joint::at_origin(0, 0),
            |n| flat[n].extend(0.0),
            |joint, axes, q, _, bone| joint.advance(axes, [angles[q], angles[q + 1]], bone, Change::default()),
            |n, joint| points[n] = joint.point,
        );
        let gauge = gauge(&points);
        points.iter_mut().for_each(|p| *p = gauge * *p);
        Self { points, gauge }
    }
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
        let raw = self.points(blade, Lattice::WHOLE);
        let gauge = gauge(&raw);
        BladeGrid { points: raw.iter().map(|p| gauge * *p).collect(), gauge }
    }

    /// The raw (ungauged) control points of a lattice.
    #[must_use]
    pub fn points(&self, blade: &Blade, lattice: Lattice) -> Vec<DVec3> {
        let mut points = vec![DVec3::ZERO; lattice.len()];
        self.bend(blade, lattice, (0, 0), |n, joint| points[n] = joint.point);
        points
    }

    /// The raw (ungauged) control points and their analytic derivatives by β, γ and ln s_x.
    #[must_use]
    pub fn jacobian(&self, blade: &Blade) -> BladeJacobian {
        self.jacobian_on(blade, Lattice::WHOLE)
    }

    /// The same of a lattice's control points.
    #[must_use]
    pub fn jacobian_on(&self, blade: &Blade, lattice: Lattice) -> BladeJacobian {
        let (shapes, bends) = (self.shape.rank(), self.deform.rank());
        let coefficients = shapes + bends + 1;
        let mut points = vec![DVec3::ZERO; lattice.len()];
        let mut derivatives = vec![0.0; 3 * coefficients * lattice.len()];
        self.bend(blade, lattice, (bends, shapes + 1), |n, joint| {
            points[n] = joint.point;
            let of_node = &mut derivatives[3 * coefficients * n..3 * coefficients * (n + 1)];
            for (axis, cells) in of_node.chunks_exact_mut(coefficients).enumerate() {
                let (swings, slides) = joint.velocity(axis);
                cells[..shapes].copy_from_slice(&slides[..shapes]);
                cells[shapes..shapes + bends].copy_from_slice(swings);
                cells[shapes + bends] = slides[shapes];
            }
        });
        BladeJacobian { points, derivatives, coefficients }
    }

    /// Bends the flat grid and shows each node of the lattice to `put`. Joints carry derivatives by γ and by β, ln s_x,
    /// or (0, 0) for none.
    fn bend(&self, blade: &Blade, lattice: Lattice, (swings, slides): (usize, usize), put: impl FnMut(usize, &Joint)) {
        let flat = |n: usize| {
            let of = |m: usize| self.shape.one(m, &blade.beta);
            DVec3::new(of(2 * n) * blade.width, of(2 * n + 1), 0.0)
        };
        let mut dbone = [vec![0.0; slides], vec![0.0; slides]];
        let advance = |joint: &mut Joint, axes: [DVec3; 2], q: usize, (to, from): (usize, usize), bone: DVec3| {
            let angles = [self.deform.one(q, &blade.gamma), self.deform.one(q + 1, &blade.gamma)];
            if slides == 0 {
                joint.advance(axes, angles, bone, Change::default());
                return;
            }
            for (axis, (cells, scale)) in dbone.iter_mut().zip([blade.width, 1.0]).enumerate() {
                let (to, from) = (self.shape.derivative(2 * to + axis), self.shape.derivative(2 * from + axis));
                for k in 0..to.len() {
                    cells[k] = (to[k] - from[k]) * scale;
                }
            }
            dbone[0][slides - 1] = bone.x;
            let change = Change {
                bone: [&dbone[0], &dbone[1]],
                angles: [self.deform.derivative(q), self.deform.derivative(q + 1)],
            };
            joint.advance(axes, angles, bone, change);
        };
        walk(lattice, &Joint::at_origin(swings, slides), flat, advance, put);
    }
}

/// Walks a blade's bones, the main vein as one chain, each inner row as two chains that leave it (paper eq. 5), and
/// shows each node of the lattice to `put`. `flat` gives nodes of the flat grid; `advance` takes a joint along a bone:
/// its two axes, its first angle's index, the nodes `(to, from)` and the bone itself.
fn walk(
    lattice: Lattice,
    start: &Joint,
    flat: impl Fn(usize) -> DVec3,
    mut advance: impl FnMut(&mut Joint, [DVec3; 2], usize, (usize, usize), DVec3),
    mut put: impl FnMut(usize, &Joint),
) {
    let mut vein = start.clone();
    for j in 0..lattice.columns() {
        put(lattice.node(0, j), &vein);
    }
    let mut last = flat(node(0, VEIN));
    for i in 1..ROWS {
        let (to, from) = (node(i, VEIN), node(i - 1, VEIN));
        let here = flat(to);
        advance(&mut vein, [DVec3::X, DVec3::Z], vein_angle(i), (to, from), here - last);
        last = here;
        if !i.is_multiple_of(lattice.along) {
            continue;
        }
        let row = i / lattice.along;
        if i == ROWS - 1 {
            // The tip row is one point.
            for j in 0..lattice.columns() {
                put(lattice.node(row, j), &vein);
            }
            break;
        }
        put(lattice.node(row, lattice.columns() / 2), &vein);
        for side in Side::BOTH {
            let mut rib = vein.clone();
            let mut inner = here;
            for k in 1..=VEIN {
                let (to, from) = (node(i, side.column(k)), node(i, side.column(k - 1)));
                let outer = flat(to);
                advance(&mut rib, [DVec3::Y, DVec3::Z], side_angle(i, side, k), (to, from), outer - inner);
                inner = outer;
                if k.is_multiple_of(lattice.across) {
                    put(lattice.node(row, side.column(k) / lattice.across), &rib);
                }
            }
        }
    }
}

/// The rotation that brings a bent grid (base at the origin) to the gauge of spec/demeter-model.md: tip on +y, mean
/// side-vein chord (right minus left) in the half-plane z = 0, x > 0.
#[must_use]
pub fn gauge(points: &[DVec3]) -> DQuat {
    frame_of(points[node(ROWS - 1, VEIN)] - points[node(0, VEIN)], across(points))
}

/// The sum of a grid's side-vein chords, right minus left: what the gauge rolls to z = 0.
pub(crate) fn across(points: &[DVec3]) -> DVec3 {
    (1..ROWS - 1).map(|i| points[node(i, COLUMNS - 1)] - points[node(i, 0)]).sum()
}

/// The rotation taking `along` to +y and `across`, made orthogonal to it, to +x; degenerate directions are replaced
/// by any orthogonal one, so the result is always a rotation.
pub(crate) fn frame_of(along: DVec3, across: DVec3) -> DQuat {
    let y = along.normalize_or(DVec3::Y);
    let x = across.reject_from_normalized(y).normalize_or(y.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).inverse()
}
