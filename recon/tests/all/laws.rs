//! Laws of the plant model (spec/demeter-model.md "Laws to test").

use crate::common::{cases, flat, random_plant, species};
use demeter_frame::Pose;
use demeter_recon::model::leaf::{self, Blade, COLUMNS, Lattice, ROWS, VEIN, node};
use demeter_recon::model::stem::{self, BONES};
use demeter_recon::model::{Detail, Form, Knots, OrganKind, PlantMesh, Species, forward};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

fn names() -> impl Strategy<Value = &'static str> {
    prop::sample::select(demeter_recon::species::NAMES.to_vec())
}

/// Coefficients within two standard deviations; as many as any species may have.
fn coefficients() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-2.0..2.0_f64, 32)
}

fn blade(species: &Species, beta: &[f64], gamma: &[f64], width: f64) -> Blade {
    let cut = |c: &[f64], rank: usize| c[..rank.min(c.len())].to_vec();
    Blade { beta: cut(beta, species.leaf.shape.rank()), gamma: cut(gamma, species.leaf.deform.rank()), width }
}

fn turn((x, y, z, w): (f64, f64, f64, f64)) -> DQuat {
    DQuat::from_xyzw(x, y, z, w + 1.5).normalize()
}

fn turns() -> impl Strategy<Value = DQuat> {
    (-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64).prop_map(turn)
}

/// The bones of a blade: pairs of neighbouring nodes along the main vein and along each inner row.
fn bones() -> impl Iterator<Item = (usize, usize)> {
    let vein = (1..ROWS).map(|i| (node(i - 1, VEIN), node(i, VEIN)));
    vein.chain((1..ROWS - 1).flat_map(|i| (1..COLUMNS).map(move |j| (node(i, j - 1), node(i, j)))))
}

proptest! {
    #![proptest_config(cases(24))]

    #[test]
    fn bending_keeps_every_bone_as_long_as_it_is(
        name in names(), beta in coefficients(), gamma in coefficients(), width in 0.5..2.0_f64,
    ) {
        let species = species(name);
        let blade = blade(&species, &beta, &gamma, width);
        let flat = species.leaf.flat(&blade.beta, width);
        let bent = species.leaf.grid(&blade).points;
        for (a, b) in bones() {
            prop_assert!((bent[a].distance(bent[b]) - flat[a].distance(flat[b])).abs() < 1e-12);
        }
        let stem = species.stem.curve(&gamma).points;
        prop_assert!(stem.windows(2).all(|p| (p[0].distance(p[1]) - 1.0 / BONES as f64).abs() < 1e-12));
    }

    #[test]
    fn gauged_organs_are_in_gauge_and_stay_there(name in names(), beta in coefficients(), gamma in coefficients()) {
        let species = species(name);
        let unturned = |q: DQuat| (q.w.abs() - 1.0).abs() < 1e-12;
        let grid = species.leaf.grid(&blade(&species, &beta, &gamma, 1.0)).points;
        prop_assert!(unturned(leaf::gauge(&grid)));
        let tip = grid[node(ROWS - 1, VEIN)];
        prop_assert!(grid[0] == DVec3::ZERO && tip.x.hypot(tip.z) < 1e-12 && tip.y > 0.0);
        let across: DVec3 = (1..ROWS - 1).map(|i| grid[node(i, COLUMNS - 1)] - grid[node(i, 0)]).sum();
        prop_assert!(across.z.abs() < 1e-9 && across.x > 0.0, "{across}");
        let stem = species.stem.curve(&gamma).points;
        prop_assert!(unturned(stem::gauge(&stem)));
        let centroid = stem.iter().copied().sum::<DVec3>() / stem.len() as f64;
        prop_assert!(centroid.x.abs() < 1e-12 && centroid.z <= 0.0, "{centroid}");
    }

    #[test]
    fn rotating_moving_or_scaling_the_root_moves_every_vertex_alike(
        name in names(), organs in 1..20_usize, seed in any::<u64>(),
        turn in turns(), shift in (-9.0..9.0_f64, -9.0..9.0_f64, -9.0..9.0_f64), grown in 0.3..3.0_f64,
    ) {
        let species = species(name);
        let plant = random_plant(&species, organs, seed);
        let motion = Pose::new(turn, DVec3::new(shift.0, shift.1, shift.2));
        let mut other = plant.clone();
        other.world_from_plant = motion.then(&plant.world_from_plant);
        other.organs[0].joint.scale *= grown;
        let [a, b] = [&plant, &other]
            .map(|p| PlantMesh::of(&forward(p, &species).unwrap(), Detail::Control, Knots::Uniform));
        let base = plant.world_from_plant.translation;
        for (a, b) in a.positions.iter().zip(&b.positions) {
            prop_assert!(motion.point(base + (*a - base) * grown).distance(*b) < 1e-9);
        }
        for (a, b) in a.normals.iter().zip(&b.normals) {
            prop_assert!((motion.rotation * *a).distance(*b) < 1e-6);
        }
    }

    #[test]
    fn organs_begin_on_their_parents(name in names(), organs in 2..20_usize, seed in any::<u64>()) {
        let species = species(name);
        let plant = random_plant(&species, organs, seed);
        let posed = forward(&plant, &species).unwrap();
        for (i, organ) in plant.organs.iter().enumerate() {
            let Some(parent) = organ.parent else { continue };
            let along = organ.joint.d * BONES as f64;
            let bone = (along as usize).min(BONES - 1);
            let stem = &posed.control[parent];
            let expected = stem[bone].lerp(stem[bone + 1], along - bone as f64);
            prop_assert!(posed.control[i][0].distance(expected) < 1e-12);
        }
    }

    #[test]
    fn meshes_have_no_degenerate_faces_and_know_their_organs(
        name in names(), organs in 1..12_usize, seed in any::<u64>(),
        detail in prop::sample::select(vec![Detail::Coarse, Detail::Control, Detail::Refined(2)]),
    ) {
        let species = species(name);
        let mut plant = random_plant(&species, organs, seed);
        // All shape coefficients far out at once turn a blade inside out; halved they leave every species a width.
        for organ in &mut plant.organs {
            if let Form::Leaf { blade, .. } = &mut organ.form {
                blade.beta.iter_mut().for_each(|beta| *beta /= 2.0);
            }
        }
        let posed = forward(&plant, &species).unwrap();
        let mesh = PlantMesh::of(&posed, detail, Knots::Uniform);
        prop_assert_eq!(mesh.organ_of_face.len(), mesh.faces.len());
        prop_assert_eq!((mesh.normals.len(), mesh.uvs.len()), (mesh.positions.len(), mesh.positions.len()));
        prop_assert!(mesh.uvs.iter().all(|uv| uv.cmpge(DVec2::ZERO).all() && uv.cmple(DVec2::ONE).all()));
        prop_assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-9));
        for face in 0..mesh.faces.len() {
            let organ = mesh.organ_of_face[face] as usize;
            let size = posed.world_from_organ[organ].scale;
            prop_assert!(mesh.face_area(face) > 1e-9 * size * size, "{name} face {face} of organ {organ}");
            // Looking at every control point is slow, so some faces stand for all.
            if face % 101 == 0 {
                let corner = mesh.corners(face)[0];
                let reach = posed.control[organ].iter().map(|p| p.distance(corner)).fold(f64::MAX, f64::min);
                prop_assert!(reach < 0.1 * size + posed.radius[organ], "{reach}");
            }
        }
        prop_assert!((0..organs as u32).all(|organ| mesh.organ_of_face.contains(&organ)));
        for (i, organ) in plant.organs.iter().enumerate() {
            let expected = match organ.form {
                Form::Leaf { .. } => OrganKind::Leaf,
                Form::Stem { .. } if i == 0 => OrganKind::MainStem,
                Form::Stem { .. } => OrganKind::Stem,
            };
            prop_assert_eq!(organ.kind(), expected);
        }
    }
}

proptest! {
    #![proptest_config(cases(4))]

    /// Central differences with a step of 1e-5 err by about 1e-10 times the third derivative and by rounding of 1e-11.
    #[test]
    fn analytic_derivatives_are_those_of_finite_differences(
        name in names(), beta in coefficients(), gamma in coefficients(), width in 0.6..1.6_f64,
        lattice in prop::sample::select(vec![Lattice::WHOLE, Lattice::every(2, 3)]),
    ) {
        const STEP: f64 = 1e-5;
        const TOLERANCE: f64 = 1e-7;
        let species = species(name);
        let at = blade(&species, &beta, &gamma, width);
        let analytic = species.leaf.jacobian_on(&at, lattice);
        let (shapes, bends) = (at.beta.len(), at.gamma.len());
        prop_assert_eq!(analytic.coefficients, shapes + bends + 1);
        for k in 0..analytic.coefficients {
            let moved = |by: f64| {
                let mut blade = at.clone();
                match k {
                    k if k < shapes => blade.beta[k] += by,
                    k if k < shapes + bends => blade.gamma[k - shapes] += by,
                    _ => blade.width *= by.exp(),
                }
                species.leaf.points(&blade, lattice)
            };
            let (after, before) = (moved(STEP), moved(-STEP));
            for (n, (after, before)) in after.iter().zip(&before).enumerate() {
                let finite = (*after - *before) / (2.0 * STEP);
                let found = analytic.derivative(n, k);
                prop_assert!(finite.distance(found) < TOLERANCE, "{name} point {n} by {k}: {finite} and {found}");
            }
        }
        let gamma = &gamma[..species.stem.deform.rank()];
        let analytic = species.stem.jacobian(gamma);
        for k in 0..gamma.len() {
            let moved = |by: f64| {
                let mut gamma = gamma.to_vec();
                gamma[k] += by;
                species.stem.jacobian(&gamma).points
            };
            let (after, before) = (moved(STEP), moved(-STEP));
            for (n, (after, before)) in after.iter().zip(&before).enumerate() {
                let finite = (*after - *before) / (2.0 * STEP);
                let found = analytic.derivatives[n * analytic.coefficients + k];
                prop_assert!(finite.distance(found) < TOLERANCE, "{name} stem point {n} by {k}: {finite} and {found}");
            }
        }
    }
}

#[test]
fn a_lattice_takes_its_points_from_the_whole_grid() {
    let species = species("tomato");
    let at = blade(&species, &[1.0, -2.0, 0.5], &[0.7; 16], 1.0);
    let whole = species.leaf.points(&at, Lattice::WHOLE);
    for (along, across) in [(1, 1), (2, 3), (4, 7), (11, 21), (44, 21)] {
        let lattice = Lattice::every(along, across);
        let points = species.leaf.points(&at, lattice);
        assert_eq!(points, species.leaf.jacobian_on(&at, lattice).points);
        assert_eq!(points.len(), lattice.len());
        for (row, column) in (0..lattice.rows()).flat_map(|i| (0..lattice.columns()).map(move |j| (i, j))) {
            assert_eq!(points[lattice.node(row, column)], whole[node(row * along, column * across)]);
        }
    }
}

/// The side that photosynthesises looks up: +z of a flat blade is the front of its faces.
#[test]
fn the_front_of_a_flat_blade_is_its_upper_side() {
    // A learned mean blade is bent.
    let species = flat("maize");
    let mut plant = random_plant(&species, 1, 0);
    plant.world_from_plant = Pose::IDENTITY;
    plant.organs[0].joint.rotation = DQuat::IDENTITY;
    let mut leaf = plant.organs[0].clone();
    leaf.parent = Some(0);
    leaf.form = Form::Leaf { blade: blade(&species, &[], &[], 1.0), leaf: 0 };
    plant.organs[0].form = Form::Stem { gamma: vec![], radius: 0.01 };
    plant.organs.push(leaf);
    for detail in [Detail::Coarse, Detail::Control, Detail::Refined(3)] {
        let mesh = PlantMesh::of(&forward(&plant, &species).unwrap(), detail, Knots::Uniform);
        let first = mesh.organ_of_face.iter().position(|organ| *organ == 1).unwrap();
        for face in first..mesh.faces.len() {
            let [a, b, c] = mesh.corners(face);
            assert!((b - a).cross(c - a).normalize().z > 0.999, "{detail:?} face {face}");
        }
    }
}
