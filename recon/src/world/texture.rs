use glam::{Vec2, Vec3};
use image::RgbaImage;

/// The picture of a leaf: linear colours, and where there is leaf at all.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: usize,
    height: usize,
    /// Row-major from the picture's upper left.
    colours: Vec<Vec3>,
    solid: Vec<bool>,
    mean: Vec3,
    solid_share: f32,
}

impl Texture {
    /// A texture of an sRGB picture; there is leaf where alpha is at least one half. `None` when that is nowhere.
    #[must_use]
    pub fn new(picture: &RgbaImage) -> Option<Self> {
        let decode: Vec<f32> = (0..=255u8).map(linear).collect();
        let colours: Vec<Vec3> = picture
            .pixels()
            .map(|p| Vec3::from_array([p.0[0], p.0[1], p.0[2]].map(|c| decode[usize::from(c)])))
            .collect();
        let solid: Vec<bool> = picture.pixels().map(|p| p.0[3] >= 128).collect();
        let count = solid.iter().filter(|s| **s).count();
        let sum: Vec3 = colours.iter().zip(&solid).filter(|(_, solid)| **solid).map(|(colour, _)| *colour).sum();
        (count > 0).then(|| Self {
            width: picture.width() as usize,
            height: picture.height() as usize,
            mean: sum / count as f32,
            solid_share: count as f32 / solid.len() as f32,
            colours,
            solid,
        })
    }

    /// Share of the picture that is leaf, 0..=1.
    #[must_use]
    pub fn solid_share(&self) -> f32 {
        self.solid_share
    }

    /// Mean linear colour of the leaf.
    pub(super) fn mean(&self) -> Vec3 {
        self.mean
    }

    /// Whether there is leaf at `uv`; outside 0..=1 the border goes on.
    pub(super) fn is_solid(&self, uv: Vec2) -> bool {
        self.solid[self.texel(uv)]
    }

    /// Linear colour at `uv`.
    pub(super) fn colour(&self, uv: Vec2) -> Vec3 {
        self.colours[self.texel(uv)]
    }

    fn texel(&self, uv: Vec2) -> usize {
        // Casts saturate, and NaN becomes 0.
        let x = ((uv.x * self.width as f32) as usize).min(self.width - 1);
        let y = ((uv.y * self.height as f32) as usize).min(self.height - 1);
        y * self.width + x
    }
}

/// sRGB's decoding (IEC 61966-2-1).
fn linear(code: u8) -> f32 {
    let x = f32::from(code) / 255.0;
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transparent_texels_are_no_leaf_and_count_in_no_mean() {
        let mut picture = RgbaImage::from_pixel(4, 2, image::Rgba([255, 255, 255, 0]));
        assert_eq!(Texture::new(&picture), None);
        picture.put_pixel(3, 1, image::Rgba([0, 188, 0, 255]));
        let texture = Texture::new(&picture).expect("one texel of leaf");
        assert_eq!(texture.solid_share(), 0.125);
        assert!((texture.mean().y - 0.5).abs() < 0.01, "sRGB 188 is about one half");
        assert!(texture.is_solid(Vec2::new(0.9, 0.9)) && texture.is_solid(Vec2::splat(7.0)));
        assert!(!texture.is_solid(Vec2::new(0.9, 0.1)) && !texture.is_solid(Vec2::splat(f32::NAN)));
    }
}
