//! A plant as its outline filled in.

use image::GrayImage;

use crate::distance::distances;

/// Which pixels of a picture show a plant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Silhouette {
    width: usize,
    height: usize,
    inside: Vec<bool>,
}

impl Silhouette {
    /// Of a picture whose plant is whatever is not 0; pixels on its border count as outside, so that every pixel inside
    /// has eight neighbours.
    #[must_use]
    pub fn of(picture: &GrayImage) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let mut inside: Vec<bool> = picture.as_raw().iter().map(|&v| v > 0).collect();
        for (p, inside) in inside.iter_mut().enumerate() {
            let (x, y) = (p % width, p / width);
            *inside &= x > 0 && y > 0 && x + 1 < width && y + 1 < height;
        }
        Self { width, height, inside }
    }

    /// Pixels of a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Whether each pixel shows the plant, row major.
    #[must_use]
    pub fn inside(&self) -> &[bool] {
        &self.inside
    }

    /// The eight neighbours of an inner pixel, clockwise from the one above.
    pub(super) fn ring(&self, p: usize) -> [usize; 8] {
        let w = self.width;
        [p - w, p - w + 1, p + 1, p + w + 1, p + w, p + w - 1, p - 1, p - w - 1]
    }

    /// Distance from the centre of each pixel inside to that of the nearest one outside, 0 outside, pixels.
    #[must_use]
    pub fn radii(&self) -> Vec<f32> {
        let found = distances(self.width, self.height, |p| !self.inside[p], false);
        found.into_iter().map(|distance| distance as f32).collect()
    }

    /// Lines one pixel wide that keep the shape's ends, joints and holes (Guo and Hall, "Parallel Thinning with
    /// Two-Subiteration Algorithms", 1989).
    #[must_use]
    pub fn thinned(&self) -> Self {
        let mut thin = self.clone();
        let mut left: Vec<usize> = (0..thin.inside.len()).filter(|&p| thin.inside[p]).collect();
        loop {
            let before = left.len();
            for pass in [false, true] {
                let gone: Vec<usize> = left.iter().copied().filter(|&p| thin.is_removable(p, pass)).collect();
                gone.iter().for_each(|&p| thin.inside[p] = false);
                left.retain(|&p| thin.inside[p]);
            }
            if left.len() == before {
                return thin;
            }
        }
    }

    fn is_removable(&self, p: usize, second: bool) -> bool {
        let n = self.ring(p).map(|q| self.inside[q]);
        let joints = (0..4).filter(|k| !n[2 * k] && (n[2 * k + 1] || n[(2 * k + 2) % 8])).count();
        let pairs = |shift: usize| (0..4).filter(|k| n[(2 * k + shift) % 8] || n[(2 * k + shift + 1) % 8]).count();
        let neighbours = pairs(0).min(pairs(7));
        let edge = if second { (n[0] || n[1] || !n[3]) && n[2] } else { (n[4] || n[5] || !n[7]) && n[6] };
        joints == 1 && (2..=3).contains(&neighbours) && !edge
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::pieces;
    use proptest::prelude::*;
    use rand::Rng;

    /// A few discs.
    fn discs(seed: u64) -> Silhouette {
        let mut rng = crate::world::seeded(seed);
        let mut picture = GrayImage::new(48, 40);
        for _ in 0..rng.random_range(1..6) {
            let (x, y, r) = (rng.random_range(0..48i32), rng.random_range(0..40i32), rng.random_range(1..9i32));
            for (px, py, pixel) in picture.enumerate_pixels_mut() {
                if (px as i32 - x).pow(2) + (py as i32 - y).pow(2) <= r * r {
                    pixel.0[0] = 255;
                }
            }
        }
        Silhouette::of(&picture)
    }

    /// How many parts the pixels inside form, over all eight neighbours.
    fn parts(shape: &Silhouette) -> usize {
        pieces(shape.inside.len(), |p| shape.ring(p).into_iter(), |p| shape.inside[p]).len()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn radii_agree_with_looking_at_every_pixel(seed in 0u64..1000) {
            let shape = discs(seed);
            let radii = shape.radii();
            for p in 0..radii.len() {
                let away = |q: usize| {
                    let (dx, dy) = ((p % 48) as f64 - (q % 48) as f64, (p / 48) as f64 - (q / 48) as f64);
                    dx.hypot(dy)
                };
                let exact = (0..radii.len()).filter(|&q| !shape.inside[q]).map(away).fold(f64::INFINITY, f64::min);
                prop_assert!((exact - f64::from(radii[p])).abs() < 1e-5, "{p}: {exact} {}", radii[p]);
            }
        }

        #[test]
        fn thin_lines_lie_inside_are_as_connected_and_cannot_be_thinned(seed in 0u64..1000) {
            let shape = discs(seed);
            let thin = shape.thinned();
            prop_assert!(thin.inside.iter().zip(&shape.inside).all(|(thin, inside)| *inside || !thin));
            prop_assert_eq!(parts(&thin), parts(&shape));
            prop_assert_eq!(&thin.thinned(), &thin);
        }
    }

    #[test]
    fn a_bar_thins_to_a_line_nearly_as_long() {
        let bar =
            GrayImage::from_fn(60, 20, |x, y| image::Luma([u8::from((5..55).contains(&x) && (7..12).contains(&y))]));
        let thin = Silhouette::of(&bar).thinned();
        let columns = (0..60).filter(|x| (0..20).any(|y| thin.inside[y * 60 + x])).count();
        assert!((44..=50).contains(&columns), "{columns}");
        assert_eq!(thin.inside.iter().filter(|inside| **inside).count(), columns, "one pixel a column");
    }

    #[test]
    fn empty_and_tiny_pictures_have_no_inside() {
        for (w, h) in [(0, 0), (1, 1), (2, 5)] {
            let shape = Silhouette::of(&GrayImage::from_pixel(w, h, image::Luma([255])));
            assert!(shape.inside.iter().all(|inside| !inside));
            assert_eq!(shape.radii().len(), shape.thinned().inside.len());
        }
    }
}
