//! How fast the renderer is: a soybean row at 640 x 480 and scenes of 1, 10 and 100 plants.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_frame::{Intrinsics, Pinhole};
use demeter_recon::species::shipped;
use demeter_recon::world::{Nursery, Row, Sensor, boundary_distance, render, row, seeded, training_view};

fn pictures(c: &mut Criterion) {
    let soybean = shipped("soybean").expect("listed").expect("valid");
    let maize = shipped("maize").expect("listed").expect("valid");
    let nursery = Nursery::new(vec![soybean.clone(), maize]);
    let intrinsics = Intrinsics::from_hfov(640, 480, 1.0);
    let mut group = c.benchmark_group("render 640x480");
    group.sample_size(10);
    for plants in [1, 10, 100] {
        let plan = Row { plants, spacing: 0.12, age: 0.4, frames: 20 };
        let (scene, poses) = row(&soybean, &plan, &intrinsics, 1).expect("few organs");
        let camera = Pinhole { intrinsics, world_from_camera: poses[10] };
        group.bench_with_input(BenchmarkId::new("row of soybeans", plants), &camera, |b, camera| {
            b.iter(|| render(black_box(&scene), camera, &Sensor::FIELD, &mut seeded(1)));
        });
    }
    group.finish();
    let mut group = c.benchmark_group("training 256x256");
    group.sample_size(10);
    group.bench_function("48 views", |b| {
        b.iter(|| {
            (0..48)
                .filter_map(|seed| training_view(&nursery, 256, seed).ok())
                .map(|(view, _)| view.organs.len())
                .sum::<usize>()
        });
    });
    let (view, _) = training_view(&nursery, 256, 5).expect("valid");
    group.bench_function("boundary distance", |b| b.iter(|| boundary_distance(black_box(&view.instances))));
    group.finish();
}

criterion_group!(benches, pictures);
criterion_main!(benches);
