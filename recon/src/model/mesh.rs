//! The plant's surface: blades as refined grids, stems as swept tubes (paper supp. "Catmull-Rom Curve").

use glam::{DQuat, DVec2, DVec3};

use super::catmull_rom::{Knots, refine};
use super::kinematics::PosedPlant;
use super::leaf::{COLUMNS, ROWS};

/// How finely a plant is meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Every 4th row and 7th column of a blade, 6-sided stems: for rendering many plants at a distance.
    Coarse,
    /// Every row and every 7th column of a blade, 6-sided stems: for margins that wave.
    Rows,
    /// The control points themselves, 8-sided stems.
    Control,
    /// Catmull-Rom with this many steps between control points.
    Refined(usize),
}

/// A triangle mesh that knows the organ of each face. Blades are single sheets whose front is the upper side.
#[derive(Clone, Debug, Default)]
pub struct PlantMesh {
    /// Vertices, metres.
    pub positions: Vec<DVec3>,
    /// Unit normals; on blades those of the upper side.
    pub normals: Vec<DVec3>,
    /// Blades: (column / 42, row / 44); stems: (around, along), both in 0..=1.
    pub uvs: Vec<DVec2>,
    /// Vertex indices, counter-clockwise from outside (from above on blades).
    pub faces: Vec<[u32; 3]>,
    /// Index of the organ of each face.
    pub organ_of_face: Vec<u32>,
}

impl PlantMesh {
    /// The mesh of every organ.
    #[must_use]
    pub fn of(posed: &PosedPlant, detail: Detail, knots: Knots) -> Self {
        let mut mesh = Self::default();
        for (organ, control) in posed.control.iter().enumerate() {
            if control.len() == ROWS * COLUMNS {
                mesh.add_blade(control, detail, knots);
            } else {
                mesh.add_stem(control, posed.radius[organ], posed.side[organ], detail, knots);
            }
            mesh.organ_of_face.resize(mesh.faces.len(), organ as u32);
        }
        mesh
    }

    /// Area of a face in square metres.
    #[must_use]
    pub fn face_area(&self, face: usize) -> f64 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a).length() / 2.0
    }

    /// The three corners of a face.
    #[must_use]
    pub fn corners(&self, face: usize) -> [DVec3; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    fn add_blade(&mut self, control: &[DVec3], detail: Detail, knots: Knots) {
        let (rows, columns, points) = blade_points(control, detail, knots);
        let first = self.positions.len() as u32;
        // Rows 0 and last are one point each, so base and tip are single vertices without degenerate triangles.
        let vertex = |i: usize, j: usize| match i {
            0 => first,
            i if i == rows - 1 => first + 1 + ((rows - 2) * columns) as u32,
            i => first + 1 + ((i - 1) * columns + j) as u32,
        };
        for i in 0..rows {
            for j in 0..columns {
                if (i == 0 || i == rows - 1) && j > 0 {
                    continue;
                }
                let u = if i == 0 || i == rows - 1 { 0.5 } else { j as f64 / (columns - 1) as f64 };
                self.positions.push(points[i * columns + j]);
                self.uvs.push(DVec2::new(u, i as f64 / (rows - 1) as f64));
            }
        }
        let start = self.faces.len();
        for i in 0..rows - 1 {
            for j in 0..columns - 1 {
                let quad = [vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j)];
                if i > 0 {
                    self.faces.push([quad[0], quad[1], quad[2]]);
                }
                if i + 2 < rows {
                    self.faces.push([quad[0], quad[2], quad[3]]);
                }
            }
        }
        self.smooth_normals(first as usize, start);
    }

    fn add_stem(&mut self, control: &[DVec3], radius: f64, side: DVec3, detail: Detail, knots: Knots) {
        let (sides, steps) = match detail {
            Detail::Coarse | Detail::Rows => (6, 1),
            Detail::Control => (8, 1),
            Detail::Refined(steps) => (12, steps),
        };
        let mut curve = refine(control, steps, knots);
        if matches!(detail, Detail::Coarse | Detail::Rows) {
            let last = curve[curve.len() - 1];
            curve = curve.into_iter().step_by(4).collect();
            curve.push(last);
        }
        let first = self.positions.len() as u32;
        let rings = curve.len();
        let mut normal = side;
        for i in 0..rings {
            let along = (curve[(i + 1).min(rings - 1)] - curve[i.saturating_sub(1)]).normalize_or(DVec3::Z);
            // Transporting the last ring's direction keeps the tube from twisting.
            normal = normal.reject_from_normalized(along).normalize_or(along.any_orthonormal_vector());
            for k in 0..sides {
                let turn = DQuat::from_axis_angle(along, std::f64::consts::TAU * k as f64 / sides as f64);
                let out = turn * normal;
                self.positions.push(curve[i] + out * radius);
                self.normals.push(out);
                self.uvs.push(DVec2::new(k as f64 / sides as f64, i as f64 / (rings - 1) as f64));
            }
        }
        let ring = |i: usize, k: usize| first + (i * sides + k % sides) as u32;
        for i in 0..rings - 1 {
            for k in 0..sides {
                self.faces.push([ring(i, k), ring(i, k + 1), ring(i + 1, k + 1)]);
                self.faces.push([ring(i, k), ring(i + 1, k + 1), ring(i + 1, k)]);
            }
        }
        for (i, outward) in [(0, curve[0] - curve[1]), (rings - 1, curve[rings - 1] - curve[rings - 2])] {
            let centre = self.positions.len() as u32;
            self.positions.push(curve[i]);
            self.normals.push(outward.normalize_or(DVec3::Z));
            self.uvs.push(DVec2::new(0.5, i as f64 / (rings - 1) as f64));
            for k in 0..sides {
                let (a, b) = if i == 0 { (ring(i, k + 1), ring(i, k)) } else { (ring(i, k), ring(i, k + 1)) };
                self.faces.push([centre, a, b]);
            }
        }
    }

    /// Area-weighted normals of the vertices from `first` on, out of the faces from `start` on.
    fn smooth_normals(&mut self, first: usize, start: usize) {
        let mut sums = vec![DVec3::ZERO; self.positions.len() - first];
        for face in start..self.faces.len() {
            let [a, b, c] = self.corners(face);
            let weighted = (b - a).cross(c - a);
            for v in self.faces[face] {
                sums[v as usize - first] += weighted;
            }
        }
        self.normals.extend(sums.into_iter().map(|n| n.normalize_or(DVec3::Z)));
    }
}

fn blade_points(control: &[DVec3], detail: Detail, knots: Knots) -> (usize, usize, Vec<DVec3>) {
    match detail {
        Detail::Coarse | Detail::Rows => {
            let step = if detail == Detail::Coarse { 4 } else { 1 };
            let points = (0..ROWS).step_by(step).flat_map(|i| (0..COLUMNS).step_by(7).map(move |j| (i, j)));
            ((ROWS - 1) / step + 1, (COLUMNS - 1) / 7 + 1, points.map(|(i, j)| control[i * COLUMNS + j]).collect())
        }
        Detail::Control => (ROWS, COLUMNS, control.to_vec()),
        Detail::Refined(steps) => {
            let wide: Vec<Vec<DVec3>> = control.chunks_exact(COLUMNS).map(|row| refine(row, steps, knots)).collect();
            let columns = wide[0].len();
            let tall: Vec<Vec<DVec3>> = (0..columns)
                .map(|j| refine(&wide.iter().map(|row| row[j]).collect::<Vec<_>>(), steps, knots))
                .collect();
            let rows = tall[0].len();
            (rows, columns, (0..rows).flat_map(|i| tall.iter().map(move |column| column[i])).collect())
        }
    }
}
