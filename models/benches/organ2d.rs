//! Milliseconds a call of the shipped network, one thread: `cargo bench -p demeter-models`.
#![allow(clippy::unwrap_used, missing_docs)]

use std::num::NonZeroUsize;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_frame::Rgb;
use demeter_models::{Organ2d, Runtime, find_manifest};

fn organ2d(c: &mut Criterion) {
    let runtime = Runtime::load(None).unwrap();
    let manifest = find_manifest("organ2d").unwrap();
    let mut group = c.benchmark_group("organ2d");
    group.sample_size(20);
    for side in [256, 384, 512] {
        let mut network = Organ2d::open(&runtime, &manifest, NonZeroUsize::MIN).unwrap().with_long_side(side).unwrap();
        let image = Rgb::from_fn(side, side, |x, y| image::Rgb([x as u8, y as u8, (x ^ y) as u8]));
        group.bench_function(BenchmarkId::from_parameter(side), |b| b.iter(|| network.run(&image).unwrap()));
    }
    let mut network = Organ2d::open(&runtime, &manifest, NonZeroUsize::MIN).unwrap();
    let image = Rgb::from_fn(640, 480, |x, y| image::Rgb([x as u8, y as u8, (x ^ y) as u8]));
    group.bench_function("640x480 at 384", |b| b.iter(|| network.run(&image).unwrap()));
    group.finish();
}

criterion_group!(benches, organ2d);
criterion_main!(benches);
