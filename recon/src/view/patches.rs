//! Connected parts of a mask.

use image::GrayImage;

use crate::graph::pieces;

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
    let around = |p: usize| {
        let (x, y) = (p % width, p / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |j| (x.saturating_sub(1)..(x + 2).min(width)).map(move |i| j * width + i))
    };
    let patch = |pixels: Vec<usize>| {
        let grown = |[x0, y0, x1, y1]: [u32; 4], &p: &usize| {
            let (x, y) = ((p % width) as u32, (p / width) as u32);
            [x0.min(x), y0.min(y), x1.max(x + 1), y1.max(y + 1)]
        };
        let bounds = pixels.iter().fold([u32::MAX, u32::MAX, 0, 0], grown);
        Patch { pixels, bounds }
    };
    pieces(width * height, around, |p| mask.as_raw()[p] > 0).into_iter().map(patch).collect()
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
