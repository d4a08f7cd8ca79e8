//! Milliseconds a call of the shipped network over points, one thread: `cargo bench -p demeter-models organ3d`. Making
//! the pyramid is not in it: see recon/benches/nearest.rs.
#![allow(clippy::unwrap_used, missing_docs)]

use std::num::NonZeroUsize;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_frame::{PointPyramid, PyramidLevel};
use demeter_models::{Organ3d, Runtime, find_manifest};

/// Points of levels 0 to 3 in a cloud of a plant with as many points as a pyramid holds.
const SIZES: [usize; 4] = [12_000, 4_096, 1_200, 350];

/// Points and neighbours by chance: what they are costs nothing.
fn pyramid(points: usize) -> PointPyramid {
    let place = |i: usize| [i % 97, i % 89, i % 101].map(|x| x as f32);
    let places = |count: usize| (0..count).map(place).collect();
    fn near<const K: usize>(count: usize, of: usize) -> Vec<[i64; K]> {
        (0..count).map(|i| std::array::from_fn(|k| ((i * 7919 + k * 104_729) % of) as i64)).collect()
    }
    let level = |k: usize| PyramidLevel {
        points: places(SIZES[k]),
        below: near(SIZES[k], SIZES[k - 1]),
        beside: near(SIZES[k], SIZES[k]),
        parent: if k < 3 { near::<1>(SIZES[k], SIZES[k + 1]).as_flattened().to_vec() } else { Vec::new() },
    };
    PointPyramid {
        points: places(points),
        up: near(points, SIZES[1]),
        finest: places(SIZES[0]),
        levels: [level(1), level(2), level(3)],
        local: vec![[0.5; 6]; SIZES[1]],
    }
}

fn organ3d(c: &mut Criterion) {
    let runtime = Runtime::load(None).unwrap();
    let mut network = Organ3d::open(&runtime, &find_manifest("organ3d").unwrap(), NonZeroUsize::MIN).unwrap();
    let mut group = c.benchmark_group("organ3d");
    group.sample_size(20);
    for points in [4_096, 16_384, 65_536] {
        let cloud = pyramid(points);
        group.bench_function(BenchmarkId::from_parameter(points), |b| b.iter(|| network.run(&cloud).unwrap()));
    }
    group.finish();
}

criterion_group!(benches, organ3d);
criterion_main!(benches);
