//! From labelled points to a record: division, tree, fit, Chamfer distance and encoding, with points and organs grown
//! by decades. Figures are ratios within one run: `make bench`.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_recon::cloud::PointCloud;
use demeter_recon::edit::{cut, graft};
use demeter_recon::metrics::chamfer;
use demeter_recon::model::{Detail, Knots, Plant, PlantMesh, Species, forward};
use demeter_recon::organs::{OrganTree, ScaleSource};
use demeter_recon::record::encode_compact;
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::world::{grow, labelled_cloud, seeded};
use demeter_recon::{fit, species, tree};
use glam::{DQuat, DVec3};

/// Turn from one leaf to the next around the main stem, radians: the golden angle.
const PHYLLOTAXIS: f64 = 2.4;

fn cloud(plant: &Plant, species: &Species, points: usize) -> PointCloud {
    labelled_cloud(plant, species, points, 0.001, &mut seeded(2)).unwrap().cloud
}

/// A soybean of at least so many organs: one leaf of a plant, again and again around its main stem.
fn with_organs(species: &Species, organs: usize) -> Plant {
    let grown = grow(species, 0.4, &mut seeded(1));
    let leaf = (1..grown.organs.len()).find(|i| grown.organs[*i].parent == Some(0)).unwrap();
    let others: Vec<usize> =
        (1..grown.organs.len()).filter(|i| *i != leaf && grown.organs[*i].parent == Some(0)).collect();
    let mut plant = cut(&grown, &others).unwrap();
    let leaf_organs = plant.organs.len() - 1;
    let copies = organs.saturating_sub(plant.organs.len()).div_ceil(leaf_organs);
    for k in 1..=copies {
        let root = plant.organs.len();
        plant = graft(&plant, 1, 0, k as f64 / (copies + 1) as f64).unwrap();
        let joint = &mut plant.organs[root].joint;
        joint.rotation = DQuat::from_rotation_y(PHYLLOTAXIS * k as f64) * joint.rotation;
    }
    plant
}

fn organ_tree(cloud: &PointCloud, species: &Species) -> OrganTree {
    tree::build(segment(cloud, species, Labels::Own, Up::Axis(DVec3::Z)).unwrap().organs).unwrap()
}

fn by_points(c: &mut Criterion) {
    let maize = species::shipped("maize").unwrap().unwrap();
    let mut group = c.benchmark_group("points");
    group.sample_size(10);
    for points in [5_000, 50_000, 500_000] {
        let cloud = cloud(&grow(&maize, 0.5, &mut seeded(1)), &maize, points);
        let tree = organ_tree(&cloud, &maize);
        group.bench_with_input(BenchmarkId::new("segment", points), &cloud, |b, cloud| {
            b.iter(|| segment(cloud, &maize, Labels::Own, Up::Axis(DVec3::Z)).unwrap());
        });
        group.bench_with_input(BenchmarkId::new("fit", points), &tree, |b, tree| {
            b.iter(|| fit::plant(tree, &maize, DVec3::Z).unwrap());
        });
        let plant = fit::plant(&tree, &maize, DVec3::Z).unwrap().plant;
        let mesh = PlantMesh::of(&forward(&plant, &maize).unwrap(), Detail::Control, Knots::Uniform);
        group.bench_with_input(BenchmarkId::new("chamfer", points), &cloud, |b, cloud| {
            b.iter(|| chamfer(&cloud.points, &mesh).unwrap());
        });
    }
    group.finish();
}

fn by_organs(c: &mut Criterion) {
    let soybean = species::shipped("soybean").unwrap().unwrap();
    let mut group = c.benchmark_group("organs");
    group.sample_size(10);
    for organs in [10, 20, 50, 100, 200] {
        let cloud = cloud(&with_organs(&soybean, organs), &soybean, 50_000);
        let tree = organ_tree(&cloud, &soybean);
        let plant = fit::plant(&tree, &soybean, DVec3::Z).unwrap().plant;
        let organs = plant.organs.len();
        group.bench_with_input(BenchmarkId::new("forward", organs), &plant, |b, plant| {
            b.iter(|| forward(plant, &soybean).unwrap());
        });
        group.bench_with_input(BenchmarkId::new("fit", organs), &tree, |b, tree| {
            b.iter(|| fit::plant(tree, &soybean, DVec3::Z).unwrap());
        });
        group.bench_with_input(BenchmarkId::new("encode", organs), &plant, |b, plant| {
            b.iter(|| encode_compact(plant, &soybean, ScaleSource::Input).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, by_points, by_organs);
criterion_main!(benches);
