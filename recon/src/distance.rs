//! The exact distance transform of a picture.

/// Distance in pixels from every pixel to the nearest one that `is`, exactly (Felzenszwalb and Huttenlocher, "Distance
/// Transforms of Sampled Functions", 2012); with `rim`, all pixels beyond the picture are such too.
pub(crate) fn distances(width: usize, height: usize, is: impl Fn(usize) -> bool, rim: bool) -> Vec<f64> {
    let far = (width * width + height * height) as f64;
    let mut squared: Vec<f64> = (0..width * height).map(|p| if is(p) { 0.0 } else { far }).collect();
    let mut line = Vec::new();
    let mut pass = |start: usize, step: usize, count: usize| {
        line.clear();
        line.extend((0..count).map(|k| squared[start + k * step]));
        for (k, d) in lower_envelope(&line).into_iter().enumerate() {
            let edge = if rim { (k + 1).min(count - k) } else { usize::MAX } as f64;
            squared[start + k * step] = d.min(edge * edge);
        }
    };
    (0..width).for_each(|x| pass(x, width, height));
    (0..height).for_each(|y| pass(y * width, 1, width));
    squared.into_iter().map(f64::sqrt).collect()
}

/// min over q of (p - q)² + f(q), for every p.
fn lower_envelope(f: &[f64]) -> Vec<f64> {
    // The parabolas on the envelope: where each is rooted and from where on it is lowest.
    let mut envelope: Vec<(usize, f64)> = Vec::new();
    for q in 0..f.len() {
        let mut from = f64::NEG_INFINITY;
        while let Some((root, start)) = envelope.last().copied() {
            let (a, b) = (q as f64, root as f64);
            from = ((f[q] + a * a) - (f[root] + b * b)) / (2.0 * (a - b));
            if from > start {
                break;
            }
            envelope.pop();
            from = f64::NEG_INFINITY;
        }
        envelope.push((q, from));
    }
    let mut k = 0;
    (0..f.len())
        .map(|p| {
            while envelope.get(k + 1).is_some_and(|(_, start)| *start < p as f64) {
                k += 1;
            }
            let root = envelope[k].0;
            (p as f64 - root as f64).powi(2) + f[root]
        })
        .collect()
}
