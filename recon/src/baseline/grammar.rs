//! The plant of the procedural baseline: an L-system of one main stem, read by a turtle.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use crate::model::{Habit, PlantMesh};

/// The eight numbers that one plant has in all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Genome {
    /// Length of the main stem, metres.
    pub stem: f64,
    /// Nodes of the main stem.
    pub nodes: usize,
    /// Length of every petiole, metres.
    pub petiole: f64,
    /// Angle between stem and petiole, radians.
    pub angle: f64,
    /// Length of every blade, metres.
    pub blade: f64,
    /// Its width over its length.
    pub width: f64,
    /// Angle by which a blade bends down from base to tip, radians.
    pub droop: f64,
    /// Turn about the stem from leaf to leaf, radians.
    pub divergence: f64,
}

/// Radius of the stems over the main stem's length; the petioles' is half of it.
const RADIUS_SHARE: f64 = 0.008;
/// Sectors along a blade.
const SECTORS: usize = 8;

/// The letters of the grammar: an apex becomes an internode, a leaf and the next apex.
#[derive(Clone, Copy, PartialEq)]
enum Letter {
    Apex,
    Internode,
    Leaf,
}

/// The word after `nodes` rewritings of a lone apex.
fn word(nodes: usize) -> Vec<Letter> {
    let mut word = vec![Letter::Apex];
    for _ in 0..nodes {
        let rewritten = |letter| match letter {
            Letter::Apex => vec![Letter::Internode, Letter::Leaf, Letter::Apex],
            other => vec![other],
        };
        word = word.into_iter().flat_map(rewritten).collect();
    }
    word
}

/// Draws the plant that stands at `base` and grows along `up`.
pub(super) fn draw(genome: &Genome, habit: Habit, base: DVec3, up: DVec3) -> PlantMesh {
    let mut mesh = PlantMesh::default();
    let radius = RADIUS_SHARE * genome.stem;
    let (mut at, mut turn) = (base, 0.0);
    for letter in word(genome.nodes) {
        match letter {
            Letter::Internode => {
                let next = at + up * (genome.stem / genome.nodes as f64);
                bar(&mut mesh, at, next, radius);
                at = next;
            }
            Letter::Leaf => {
                let out = DQuat::from_axis_angle(up, turn) * up.any_orthonormal_vector();
                let side = up.cross(out);
                let along = up * genome.angle.cos() + out * genome.angle.sin();
                let end = at + along * genome.petiole;
                bar(&mut mesh, at, end, radius / 2.0);
                // A compound leaf is taken to have three leaflets at right angles.
                let turns: &[f64] = if habit == Habit::Compound { &[0.0, PI / 2.0, -PI / 2.0] } else { &[0.0] };
                for turn in turns {
                    let level = DQuat::from_axis_angle(side.cross(along), *turn);
                    blade(&mut mesh, end, level * along, level * side, genome);
                }
                turn += genome.divergence;
            }
            Letter::Apex => {}
        }
    }
    mesh.organ_of_face = vec![0; mesh.faces.len()];
    mesh
}

/// A triangular prism.
fn bar(mesh: &mut PlantMesh, from: DVec3, to: DVec3, radius: f64) {
    let along = (to - from).normalize_or(DVec3::Z);
    let first = mesh.positions.len() as u32;
    for k in 0..3 {
        let turn = DQuat::from_axis_angle(along, f64::from(k) * PI * 2.0 / 3.0);
        let out = turn * along.any_orthonormal_vector() * radius;
        mesh.positions.extend([from + out, to + out]);
    }
    for k in 0..3 {
        let [a, b] = [first + 2 * k, first + 2 * ((k + 1) % 3)];
        mesh.faces.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
    }
}

/// A blade that leaves along `along`, bending about `side`.
fn blade(mesh: &mut PlantMesh, base: DVec3, along: DVec3, side: DVec3, genome: &Genome) {
    let first = mesh.positions.len() as u32;
    let mut at = base;
    for k in 0..=SECTORS {
        let share = k as f64 / SECTORS as f64;
        let half = genome.blade * genome.width / 2.0 * (PI * share).sin().max(0.0).sqrt();
        mesh.positions.extend([at - side * half, at + side * half]);
        at += DQuat::from_axis_angle(side, genome.droop * share) * along * (genome.blade / SECTORS as f64);
    }
    for k in 0..SECTORS as u32 {
        let [a, b] = [first + 2 * k, first + 2 * k + 1];
        mesh.faces.extend([[a, b, b + 2], [a, b + 2, a + 2]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_has_an_internode_and_a_leaf() {
        let count = |letter| word(5).into_iter().filter(|l| *l == letter).count();
        assert_eq!([Letter::Internode, Letter::Leaf, Letter::Apex].map(count), [5, 5, 1]);
    }

    #[test]
    fn a_blade_droops_and_the_plant_is_as_tall_as_its_stem() {
        let stiff = Genome {
            stem: 1.0,
            nodes: 4,
            petiole: 0.1,
            angle: PI / 2.0,
            blade: 0.3,
            width: 0.4,
            droop: 0.0,
            divergence: PI,
        };
        let height = |genome: &Genome| {
            let mesh = draw(genome, Habit::Simple, DVec3::ZERO, DVec3::Z);
            mesh.positions.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), p| (low.min(p.z), high.max(p.z)))
        };
        assert!((height(&stiff).1 - 1.0).abs() < 0.02 && height(&stiff).0.abs() < 1e-9);
        let drooping = Genome { droop: 1.5, nodes: 1, ..stiff };
        let tip = draw(&drooping, Habit::Simple, DVec3::ZERO, DVec3::Z).positions.last().copied().unwrap();
        assert!(tip.z < 1.0 - 0.1, "{tip}");
    }
}
