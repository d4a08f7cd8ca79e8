//! The fit of one stem, its points grown by decades: a plant of a main stem alone.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_recon::model::OrganKind;
use demeter_recon::organs::{OrganCloud, OrganTree};
use demeter_recon::world::{grow, labelled_cloud, seeded};
use demeter_recon::{fit, species};
use glam::DVec3;

fn by_points(c: &mut Criterion) {
    let soybean = species::shipped("soybean").unwrap().unwrap();
    let mut plant = grow(&soybean, 0.5, &mut seeded(1));
    plant.organs.truncate(1);
    let mut group = c.benchmark_group("stem");
    group.sample_size(10);
    for count in [500, 5_000, 50_000] {
        let points = labelled_cloud(&plant, &soybean, count, 0.0005, &mut seeded(2)).unwrap().cloud.points;
        let source = (0..points.len() as u32).collect();
        let main = OrganCloud { kind: OrganKind::MainStem, points, source };
        let tree = OrganTree { organs: vec![main], parent: vec![None] };
        group.bench_with_input(BenchmarkId::new("fit", count), &tree, |b, tree| {
            b.iter(|| fit::plant(tree, &soybean, DVec3::Z).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, by_points);
criterion_main!(benches);
