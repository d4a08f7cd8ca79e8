use demeter_frame::{Instances, Mask};

/// A candidate: the nearest pixel of some organ.
#[derive(Clone, Copy)]
struct Nearest {
    instance: u16,
    x: i32,
    y: i32,
}

/// No candidate.
const NOBODY: Nearest = Nearest { instance: 0, x: 0, y: 0 };

/// The truncated inverse distance of each organ pixel: δ / max(d, δ) with d the distance in pixels to the nearest
/// pixel of ANOTHER organ and δ = 1 % of the image's diagonal (paper 3.2's boundary distance, in images); 0 on the
/// background and where there is no other organ.
///
/// Each pixel carries the nearest pixels of two different organs through four sweeps (Danielsson, "Euclidean
/// distance mapping", 1980, with two candidates): d is exact but for rare cases off by a fraction of a pixel.
#[must_use]
pub fn boundary_distance(instances: &Instances) -> Mask {
    let (width, height) = (instances.width() as i32, instances.height() as i32);
    let mut nearest: Vec<[Nearest; 2]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .zip(instances.as_raw())
        .map(|((x, y), instance)| [Nearest { instance: *instance, x, y }, NOBODY])
        .collect();
    let mut pull = |x: i32, y: i32, dx: i32, dy: i32| {
        let (sx, sy) = (x + dx, y + dy);
        if sx < 0 || sy < 0 || sx >= width || sy >= height {
            return;
        }
        let (from, to) = ((sy * width + sx) as usize, (y * width + x) as usize);
        let offered = nearest[from];
        for candidate in offered {
            if candidate.instance > 0 {
                keep(&mut nearest[to], candidate, x, y);
            }
        }
    };
    for y in 0..height {
        for x in 0..width {
            for (dx, dy) in [(-1, 0), (-1, -1), (0, -1), (1, -1)] {
                pull(x, y, dx, dy);
            }
        }
        for x in (0..width).rev() {
            pull(x, y, 1, 0);
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            for (dx, dy) in [(1, 0), (1, 1), (0, 1), (-1, 1)] {
                pull(x, y, dx, dy);
            }
        }
        for x in 0..width {
            pull(x, y, -1, 0);
        }
    }
    let delta = 0.01 * f32::hypot(width as f32, height as f32);
    Mask::from_fn(instances.width(), instances.height(), |x, y| {
        let other = nearest[(y as i32 * width + x as i32) as usize][1];
        let own = instances.get_pixel(x, y).0[0];
        let d = f32::hypot(x as f32 - other.x as f32, y as f32 - other.y as f32);
        image::Luma([if own == 0 || other.instance == 0 { 0.0 } else { delta / d.max(delta) }])
    })
}

/// Keeps the two nearest candidates of different organs, nearest first.
fn keep(pair: &mut [Nearest; 2], candidate: Nearest, x: i32, y: i32) {
    let distance = |n: &Nearest| {
        if n.instance == 0 { i32::MAX } else { (n.x - x) * (n.x - x) + (n.y - y) * (n.y - y) }
    };
    let d = distance(&candidate);
    let [first, second] = *pair;
    if d < distance(&first) {
        pair[1] = if first.instance == candidate.instance { second } else { first };
        pair[0] = candidate;
    } else if candidate.instance != first.instance && d < distance(&second) {
        pair[1] = candidate;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sweeps_agree_with_looking_at_every_pair(seed in 0u64..500, count in 1usize..7) {
            use rand::Rng;
            let (w, h) = (40u32, 30u32);
            let mut rng = crate::world::seeded(seed);
            let mut instances = Instances::new(w, h);
            for k in 0..count {
                let (x, y, r) = (rng.random_range(0..w), rng.random_range(0..h), rng.random_range(1..9u32));
                for (px, py) in (0..h).flat_map(|py| (0..w).map(move |px| (px, py))) {
                    if px.abs_diff(x).pow(2) + py.abs_diff(y).pow(2) <= r * r {
                        instances.put_pixel(px, py, image::Luma([k as u16 + 1]));
                    }
                }
            }
            let target = boundary_distance(&instances);
            let delta = 0.5;
            for (x, y, own) in instances.enumerate_pixels() {
                let others = instances.enumerate_pixels().filter(|o| o.2.0[0] > 0 && o.2 != own);
                let d = others.map(|o| f32::hypot(o.0 as f32 - x as f32, o.1 as f32 - y as f32)).reduce(f32::min);
                let exact = match d { Some(d) if own.0[0] > 0 => delta / d.max(delta), _ => 0.0 };
                let found = target.get_pixel(x, y).0[0];
                prop_assert!((exact - found).abs() <= 0.02 * exact + 1e-6, "at {x} {y}: {exact} {found}");
            }
        }
    }
}
