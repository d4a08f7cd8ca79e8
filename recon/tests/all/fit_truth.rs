//! Plants of the synthetic world, sampled, divided by their labels and fitted: what comes back is what grew.
//! Judged on truth that the fit has not seen; figures on real scans are the command line's (`demeter fit`).

use demeter_recon::metrics::chamfer;
use demeter_recon::model::{Detail, Knots, OrganKind, Plant, PlantMesh, Species, forward};
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::world::{grow, labelled_cloud, seeded};
use demeter_recon::{fit, species, tree};
use glam::DVec3;

struct Figures {
    blades: usize,
    leaf_area: f64,
    height: f64,
}

fn figures(plant: &Plant, species: &Species) -> (Figures, PlantMesh) {
    let mesh = PlantMesh::of(&forward(plant, species).unwrap(), Detail::Control, Knots::Uniform);
    let is_leaf = |face: usize| plant.organs[mesh.organ_of_face[face] as usize].kind() == OrganKind::Leaf;
    let figures = Figures {
        blades: plant.organs.iter().filter(|o| o.kind() == OrganKind::Leaf).count(),
        leaf_area: (0..mesh.faces.len()).filter(|f| is_leaf(*f)).map(|f| mesh.face_area(f)).sum(),
        height: mesh.positions.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max),
    };
    (figures, mesh)
}

/// Fits `count` points of a grown plant; returns truth, fit and CD.
fn fitted(name: &str, age: f64, seed: u64, noise: f64) -> (Figures, Figures, f64) {
    let species = species::shipped(name).unwrap().unwrap();
    let mut rng = seeded(seed);
    let grown = grow(&species, age, &mut rng);
    let cloud = labelled_cloud(&grown, &species, 20_000, noise, &mut rng).unwrap().cloud;
    let segmented = segment(&cloud, &species, Labels::Own, Up::Axis(DVec3::Z)).unwrap();
    let tree = tree::build(segmented.organs).unwrap();
    let plant = fit::plant(&tree, &species, segmented.up).unwrap().plant;
    let (found, mesh) = figures(&plant, &species);
    let cd = chamfer(&cloud.points, &mesh).unwrap().cd;
    (figures(&grown, &species).0, found, cd)
}

#[test]
fn grown_plants_come_back_from_their_labelled_points() {
    for (name, worst_cd) in [("soybean", 0.006), ("maize", 0.006)] {
        for (age, seed) in [(0.25, 1), (0.5, 2), (0.75, 3)] {
            let (truth, found, cd) = fitted(name, age, seed, 0.001);
            let area = found.leaf_area / truth.leaf_area;
            let shown = format!(
                "{name} {age}: blades {} of {}, area x {area:.3}, height {:.3} of {:.3} m, CD {cd:.4}",
                found.blades, truth.blades, found.height, truth.height
            );
            assert_eq!(found.blades, truth.blades, "{shown}");
            assert!((0.85..1.15).contains(&area), "{shown}");
            assert!((found.height - truth.height).abs() < 0.03 * truth.height, "{shown}");
            assert!(cd < worst_cd, "{shown}");
            eprintln!("{shown}");
        }
    }
}

#[test]
fn noise_costs_chamfer_distance() {
    // The negative control: a figure that does not get worse with worse data measures nothing.
    let (_, _, clean) = fitted("maize", 0.5, 4, 0.0);
    let (_, _, noisy) = fitted("maize", 0.5, 4, 0.01);
    assert!(noisy > 1.5 * clean, "clean {clean}, noisy {noisy}");
}
