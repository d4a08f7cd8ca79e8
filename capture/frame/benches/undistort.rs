//! What a lens with distortion costs: the table of a camera, once, and each of its pictures.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_frame::{Calibration, Distortion, Intrinsics, Rgb, Undistort};

fn pictures(c: &mut Criterion) {
    let lens = Distortion::PlumbBob { coefficients: [-0.28, 0.07, 1e-3, -5e-4, 0.0] };
    let mut group = c.benchmark_group("undistort");
    group.sample_size(10);
    for (width, height) in [(640, 480), (1920, 1080)] {
        let camera = Calibration::new(Intrinsics::from_hfov(width, height, 1.1), Some(lens)).expect("a lens");
        let size = format!("{width}x{height}");
        group.bench_function(BenchmarkId::new("table", &size), |b| b.iter(|| Undistort::of(black_box(&camera))));
        let table = Undistort::of(&camera).expect("it bends");
        let picture = Rgb::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, (x ^ y) as u8]));
        group.bench_function(BenchmarkId::new("picture", &size), |b| b.iter(|| table.picture(black_box(&picture))));
    }
    group.finish();
}

criterion_group!(benches, pictures);
criterion_main!(benches);
