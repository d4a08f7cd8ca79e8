//! Nearest neighbours on a plant's points, grown by decades: building the search, and one query a point; and the
//! pyramid that a network over points takes.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use demeter_recon::nearest::Nearest;
use demeter_recon::world::{grow, labelled_cloud, seeded};
use demeter_recon::{pyramid, species};

fn by_points(c: &mut Criterion) {
    let soybean = species::shipped("soybean").unwrap().unwrap();
    let plant = grow(&soybean, 0.5, &mut seeded(1));
    let mut group = c.benchmark_group("nearest");
    group.sample_size(10);
    for count in [5_000, 50_000, 500_000] {
        let cloud = |seed| labelled_cloud(&plant, &soybean, count, 0.001, &mut seeded(seed)).unwrap().cloud.points;
        let (points, queries) = (cloud(2), cloud(3));
        group.throughput(Throughput::Elements(count as u64));
        group.bench_with_input(BenchmarkId::new("build", count), &points, |b, points| {
            b.iter(|| Nearest::of(points));
        });
        let search = Nearest::of(&points);
        group.bench_with_input(BenchmarkId::new("query", count), &queries, |b, queries| {
            b.iter(|| queries.iter().filter_map(|p| search.one(*p)).map(|n| n.distance_squared).sum::<f64>());
        });
    }
    group.finish();
    let mut group = c.benchmark_group("pyramid");
    group.sample_size(10);
    for count in [4_096, 16_384, 65_536] {
        let points = labelled_cloud(&plant, &soybean, count, 0.001, &mut seeded(2)).unwrap().cloud.points;
        group.bench_with_input(BenchmarkId::from_parameter(count), &points, |b, points| {
            b.iter(|| pyramid::of(points).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, by_points);
criterion_main!(benches);
