//! Connected parts of a mask.

use image::GrayImage;

/// Connected pixels of a mask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Patch {
    /// Their numbers, row major, the first of them first.
    pub pixels: Vec<usize>,
    /// Box `[x0, y0, x1, y1]`, the last not included.
    pub bounds: [u32; 4],
}

/// The parts of a mask's pixels above 0 that hang together over any of their eight neighbours, by their first pixels.
#[must_use]
pub fn patches(mask: &GrayImage) -> Vec<Patch> {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let mut left: Vec<bool> = mask.as_raw().iter().map(|&v| v > 0).collect();
    let mut patches = Vec::new();
    for start in 0..left.len() {
        if !std::mem::replace(&mut left[start], false) {
            continue;
        }
        let mut pixels = vec![start];
        let mut bounds = [u32::MAX, u32::MAX, 0, 0];
        let mut next = 0;
        while let Some(&p) = pixels.get(next) {
            let (x, y) = (p % width, p / width);
            let [x0, y0, x1, y1] = bounds;
            bounds = [x0.min(x as u32), y0.min(y as u32), x1.max(x as u32 + 1), y1.max(y as u32 + 1)];
            for j in y.saturating_sub(1)..(y + 2).min(height) {
                let beside = x.saturating_sub(1)..(x + 2).min(width);
                pixels.extend(beside.map(|i| j * width + i).filter(|&q| std::mem::replace(&mut left[q], false)));
            }
            next += 1;
        }
        patches.push(Patch { pixels, bounds });
    }
    patches
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn patches_hold_every_pixel_once_and_none_touches_another(raw in prop::collection::vec(0u8..2, 63)) {
            let mask = GrayImage::from_raw(9, 7, raw.clone()).unwrap();
            let found = patches(&mask);
            let mut owner = [usize::MAX; 63];
            for (k, patch) in found.iter().enumerate() {
                for &p in &patch.pixels {
                    prop_assert!(raw[p] > 0 && owner[p] == usize::MAX);
                    let (x, y) = ((p % 9) as u32, (p / 9) as u32);
                    let [x0, y0, x1, y1] = patch.bounds;
                    prop_assert!(x0 <= x && x < x1 && y0 <= y && y < y1);
                    owner[p] = k;
                }
            }
            for p in (0..63).filter(|&p| raw[p] > 0) {
                prop_assert!(owner[p] != usize::MAX);
                for q in (0..63).filter(|&q| raw[q] > 0 && (q % 9).abs_diff(p % 9) < 2 && (q / 9).abs_diff(p / 9) < 2) {
                    prop_assert_eq!(owner[p], owner[q]);
                }
            }
        }
    }

    #[test]
    fn boxes_are_tight() {
        let mut mask = GrayImage::new(8, 8);
        for (x, y) in [(2, 3), (3, 4), (7, 0)] {
            mask.put_pixel(x, y, Luma([9]));
        }
        let found: Vec<_> = patches(&mask).into_iter().map(|patch| (patch.pixels.len(), patch.bounds)).collect();
        assert_eq!(found, [(1, [7, 0, 8, 1]), (2, [2, 3, 4, 5])]);
    }
}
