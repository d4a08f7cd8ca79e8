use image::{ImageBuffer, Luma, RgbImage};
use serde::{Deserialize, Serialize};

/// An 8-bit colour image.
pub type Rgb = RgbImage;

/// Depth along the camera's z axis; metres when metric; 0 or less, or NaN, means none.
pub type Depth = ImageBuffer<Luma<f32>, Vec<f32>>;

/// One value a pixel in 0..=1, for example a probability or a truncated inverse distance.
pub type Mask = ImageBuffer<Luma<f32>, Vec<f32>>;

/// An organ's instance id per pixel, 0 for background.
pub type Instances = ImageBuffer<Luma<u16>, Vec<u16>>;

/// What a pixel or a point belongs to; the numbers are the channels of `sem` in spec/models.md.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Semantic {
    /// Soil, pot, sky, residue.
    Background = 0,
    /// A leaf blade or leaflet.
    Leaf = 1,
    /// A branch, petiole or petiolule.
    Stem = 2,
    /// The main stem.
    MainStem = 3,
}

impl Semantic {
    /// All classes in channel order.
    pub const ALL: [Self; 4] = [Self::Background, Self::Leaf, Self::Stem, Self::MainStem];
}
