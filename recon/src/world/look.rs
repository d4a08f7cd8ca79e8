use std::sync::Arc;

use demeter_frame::Semantic;
use glam::Vec3;
use rand::Rng;

use super::mesh::MeshOrgan;
use super::{Seeded, Texture};

/// How an instance looks; instance 0 is the pots.
#[derive(Clone, Debug)]
pub(super) struct Look {
    pub semantic: Semantic,
    pub plant: u32,
    pub organ: u32,
    /// Linear reflectance; a textured organ's is its picture's, drawn towards this one by `recolour`, 0..=1.
    pub colour: Vec3,
    pub texture: Option<Arc<Texture>>,
    pub recolour: f32,
    /// How much the drawn veins of untextured blades stand out, 0..=1.
    pub vein: f32,
    pub yellow: f32,
    /// Share of the light that the surface mirrors, and how sharply: the exponent of the glint.
    pub gloss: f32,
    pub polish: f32,
    /// How much the surface is crinkled, as a share of its normal.
    pub crinkle: f32,
    pub seed: u32,
}

impl Look {
    /// The look of pots.
    pub(super) fn pot(colour: Vec3, rng: &mut Seeded) -> Self {
        Self {
            semantic: Semantic::Background,
            plant: 0,
            organ: 0,
            colour,
            texture: None,
            recolour: 0.0,
            vein: 0.0,
            yellow: 0.0,
            gloss: 0.05,
            polish: 24.0,
            crinkle: 0.0,
            seed: rng.random(),
        }
    }
}

/// What the plants of one scene share: they are of one variety. Reflectances are about those of green leaves in red,
/// green and blue (a guess from photographs).
pub(super) struct Variety {
    green: Vec3,
    stem: Vec3,
    /// How far main stems go to purple, 0..=1.
    purple: f32,
    recolour: f32,
    vein: f32,
    gloss: f32,
    polish: f32,
    crinkle: f32,
}

impl Variety {
    pub(super) fn random(rng: &mut Seeded) -> Self {
        // Yellower greens are also lighter, bluer ones (cabbage, sugar beet) greyer.
        let green = Vec3::new(0.045, 0.13, 0.03).lerp(Vec3::new(0.15, 0.28, 0.045), rng.random());
        let green = green.lerp(Vec3::new(0.10, 0.19, 0.11), rng.random::<f32>().powi(3));
        let green = green * Vec3::new(shift(rng, 0.15), shift(rng, 0.15), shift(rng, 0.4));
        Self {
            green,
            stem: green.lerp(Vec3::new(0.22, 0.30, 0.11), rng.random_range(0.1..0.8)),
            purple: if rng.random_bool(0.3) { rng.random_range(0.0..0.9) } else { 0.0 },
            recolour: rng.random(),
            vein: rng.random_range(0.1..0.9),
            gloss: rng.random_range(0.0f32..0.6).powi(2),
            polish: rng.random_range(6.0..50.0),
            crinkle: rng.random_range(0.0f32..0.7).powi(2),
        }
    }
}

/// A factor around 1.
fn shift(rng: &mut Seeded, by: f32) -> f32 {
    1.0 + by * (2.0 * rng.random::<f32>() - 1.0)
}

/// Looks of a plant's organs: each plant and organ a little different, the lowest leaves sometimes yellow.
pub(super) fn looks(organs: &[MeshOrgan], variety: &Variety, plant: u32, rng: &mut Seeded) -> Vec<Look> {
    let own = Vec3::new(shift(rng, 0.12), shift(rng, 0.1), shift(rng, 0.12));
    let yellow = if rng.random_bool(0.3) { rng.random_range(0.0..0.9) } else { 0.0 };
    let looks = organs.iter().enumerate().map(|(index, organ)| {
        let colour = match organ.semantic {
            Semantic::MainStem => variety.stem.lerp(Vec3::new(0.13, 0.04, 0.05), variety.purple),
            Semantic::Stem => variety.stem.lerp(Vec3::new(0.16, 0.05, 0.06), 0.5 * variety.purple),
            Semantic::Leaf | Semantic::Background => variety.green,
        };
        let low = 1.0 - index as f32 / organs.len() as f32;
        let spots: f32 = rng.random();
        Look {
            semantic: organ.semantic,
            plant,
            organ: index as u32,
            colour: colour * own * shift(rng, 0.2),
            texture: organ.texture.clone(),
            recolour: variety.recolour,
            vein: variety.vein,
            yellow: yellow * low * low * spots,
            gloss: variety.gloss,
            polish: variety.polish,
            crinkle: variety.crinkle,
            seed: rng.random(),
        }
    });
    looks.collect()
}
