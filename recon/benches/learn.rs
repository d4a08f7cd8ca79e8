//! From a mask to a grid, with masks grown by decades of pixels: tracing grows with them, the grid does not.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use demeter_recon::learn::{Ends, Outline, harmonic, oval};
use glam::DVec2;
use image::{GrayImage, Luma};

/// A leaf with `lobes` lobes in a picture of `size` pixels a side, base at the bottom.
fn leaf(size: u32, lobes: f64) -> GrayImage {
    GrayImage::from_fn(size, size, |x, y| {
        let p = (DVec2::new(f64::from(x), f64::from(y)) / f64::from(size) - 0.5) * 2.0;
        let radius = 0.7 * (1.0 + 0.25 * (lobes * (-p.y).atan2(p.x) - lobes * std::f64::consts::FRAC_PI_2).cos());
        Luma([if p.length() < radius { 255 } else { 0 }])
    })
}

fn mask_to_grid(c: &mut Criterion) {
    let mut group = c.benchmark_group("leaf shape");
    group.sample_size(10);
    // 162² is 26,000 pixels; each next size has ten times as many.
    for size in [162, 512, 1619] {
        let lobed = leaf(size, 5.0);
        group.bench_with_input(BenchmarkId::new("trace", size), &lobed, |b, mask| {
            b.iter(|| Outline::trace(mask, Ends::Bottom).unwrap());
        });
        let outline = Outline::trace(&lobed, Ends::Bottom).unwrap().outline;
        group.bench_with_input(BenchmarkId::new("harmonic", size), &outline, |b, outline| {
            b.iter(|| harmonic(outline).unwrap());
        });
        let outline = Outline::trace(&leaf(size, 0.0), Ends::Bottom).unwrap().outline;
        group.bench_with_input(BenchmarkId::new("oval", size), &outline, |b, outline| {
            b.iter(|| oval(outline).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, mask_to_grid);
criterion_main!(benches);
