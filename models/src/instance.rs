use demeter_frame::Semantic;
use image::{GrayImage, Luma};

/// Most instances taken of one picture, the surest first: YOLO's own bound, thrice Mask R-CNN's.
pub(crate) const MAX_INSTANCES: usize = 300;

/// One organ that a network found.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// What it is.
    pub organ: Semantic,
    /// How sure the network is, 0 to 1.
    pub score: f32,
    /// The pixel of the picture, column and row, where the mask begins.
    pub at: [u32; 2],
    /// 255 where it is, 0 elsewhere.
    pub mask: GrayImage,
}

/// A box in continuous pixels of the picture: `[x0, y0, x1, y1]`.
pub(crate) type Bounds = [f32; 4];

impl Instance {
    /// The pixels inside a box for which `is` holds of their centres; `None` when there are none, or when the class is no
    /// organ.
    pub(crate) fn inside(
        bounds: Bounds,
        (width, height): (u32, u32),
        organ: Option<Semantic>,
        score: f32,
        is: impl Fn(f32, f32) -> bool,
    ) -> Option<Self> {
        let organ = organ.filter(|&organ| organ != Semantic::Background)?;
        let [x0, y0, x1, y1] = bounds;
        // Pixels whose centres are inside; casts saturate, so boxes beyond the picture end at its border.
        let first = |low: f32| (low - 0.5).ceil().max(0.0) as u32;
        let last = |high: f32, side: u32| ((high - 0.5).floor() + 1.0).max(0.0).min(side as f32) as u32;
        let (left, top) = (first(x0), first(y0));
        let (right, bottom) = (last(x1, width), last(y1, height));
        if left >= right || top >= bottom {
            return None;
        }
        let mask = GrayImage::from_fn(right - left, bottom - top, |x, y| {
            let inside = is((left + x) as f32 + 0.5, (top + y) as f32 + 0.5);
            Luma([if inside { 255 } else { 0 }])
        });
        mask.iter().any(|&pixel| pixel > 0).then_some(Self { organ, score, at: [left, top], mask })
    }

    /// The picture's pixels that belong to it.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> {
        let [left, top] = self.at;
        let inside = self.mask.enumerate_pixels().filter(|(_, _, pixel)| pixel.0[0] > 0);
        inside.map(move |(x, y, _)| (left + x, top + y))
    }
}

/// The organ that a manifest says a class number is.
pub(crate) fn organ(classes: &[Semantic], class: i64) -> Option<Semantic> {
    classes.get(usize::try_from(class).ok()?).copied()
}

/// The places of the surest scores, at least `least`, the surest first.
pub(crate) fn surest<'a>(scores: impl IntoIterator<Item = &'a f32>, least: f32) -> Vec<usize> {
    let mut sure: Vec<(usize, f32)> =
        scores.into_iter().copied().enumerate().filter(|&(_, score)| score >= least).collect();
    sure.sort_by(|(i, a), (j, b)| b.total_cmp(a).then(i.cmp(j)));
    sure.into_iter().map(|(i, _)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_end_at_the_border_and_empty_ones_are_none() {
        let leaf = Some(Semantic::Leaf);
        let whole = Instance::inside([-1e30, -5.0, 1e30, 5.0], (8, 4), leaf, 1.0, |_, _| true).unwrap();
        assert_eq!((whole.at, whole.mask.dimensions()), ([0, 0], (8, 4)));
        let one = Instance::inside([2.0, 1.0, 4.0, 3.0], (8, 4), leaf, 1.0, |x, _| x > 3.0).unwrap();
        assert_eq!(one.pixels().collect::<Vec<_>>(), [(3, 1), (3, 2)]);
        for empty in [[3.0, 0.0, 3.0, 4.0], [5.0, 0.0, 2.0, 4.0], [9.0, 0.0, 12.0, 4.0], [-9.0, 0.0, -2.0, 4.0]] {
            assert_eq!(Instance::inside(empty, (8, 4), leaf, 1.0, |_, _| true), None, "{empty:?}");
        }
        assert_eq!(Instance::inside([0.0, 0.0, 8.0, 4.0], (8, 4), leaf, 1.0, |_, _| false), None);
        for none in [None, Some(Semantic::Background)] {
            assert_eq!(Instance::inside([0.0, 0.0, 8.0, 4.0], (8, 4), none, 1.0, |_, _| true), None);
        }
        assert_eq!(organ(&[Semantic::Leaf], -1), None);
        assert_eq!(surest(&[0.2, 0.9, 0.5, 0.9], 0.5), [1, 3, 2]);
    }
}
