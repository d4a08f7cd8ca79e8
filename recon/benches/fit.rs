//! From labelled points to a record: division, tree, fit, Chamfer distance and encoding, with points and organs grown
//! by decades. Figures are ratios within one run: `make bench`.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_recon::cloud::PointCloud;
use demeter_recon::metrics::chamfer;
use demeter_recon::model::{Detail, Habit, Knots, PlantMesh, Species, forward};
use demeter_recon::organs::{OrganTree, ScaleSource};
use demeter_recon::record::encode_compact;
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::world::{grow, labelled_cloud, seeded};
use demeter_recon::{fit, species, tree};
use glam::DVec3;

fn cloud(species: &Species, age: f64, points: usize) -> PointCloud {
    let plant = grow(species, age, &mut seeded(1));
    labelled_cloud(&plant, species, points, 0.001, &mut seeded(2)).unwrap().cloud
}

fn organ_tree(cloud: &PointCloud, habit: Habit) -> OrganTree {
    tree::build(segment(cloud, habit, Labels::Own, Up::Axis(DVec3::Z)).unwrap().organs).unwrap()
}

fn by_points(c: &mut Criterion) {
    let maize = species::shipped("maize").unwrap().unwrap();
    let mut group = c.benchmark_group("points");
    group.sample_size(10);
    for points in [5_000, 50_000, 500_000] {
        let cloud = cloud(&maize, 0.5, points);
        let tree = organ_tree(&cloud, maize.habit);
        group.bench_with_input(BenchmarkId::new("segment", points), &cloud, |b, cloud| {
            b.iter(|| segment(cloud, maize.habit, Labels::Own, Up::Axis(DVec3::Z)).unwrap());
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
    for age in [0.1, 0.4, 1.0] {
        let cloud = cloud(&soybean, age, 50_000);
        let tree = organ_tree(&cloud, soybean.habit);
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
