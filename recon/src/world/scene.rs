use glam::{Vec2, Vec3};
use rand::Rng;

use demeter_frame::Semantic;

use super::shade::Shadow;
use super::surface::Surface;
use super::{Seeded, seeded};
use crate::model::{Detail, Knots, OrganKind, Plant, PlantError, PlantMesh, Species, forward};

/// Why plants make no scene.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum WorldError {
    /// One of them is no plant.
    #[error("plant {plant}: {error}")]
    Plant {
        /// Which.
        plant: usize,
        /// Why.
        error: PlantError,
    },
    /// More organs than a 16-bit instance mask can tell apart.
    #[error("expected at most {expected} organs in a scene, found {found}")]
    TooManyOrgans {
        /// The bound.
        expected: usize,
        /// How many.
        found: usize,
    },
}

/// The horizontal plane that everything stands on or over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Its height, metres; plants stand at 0, so a pot's floor lies below.
    pub z: f64,
    /// What it looks like.
    pub surface: Surface,
}

/// What is seen above and behind the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Backdrop {
    /// Sky of this brightness, without depth.
    Sky {
        /// Linear brightness overhead.
        brightness: f32,
    },
    /// A vertical wall at y = `distance` that gives its own light, as the back of an imaging chamber does.
    Wall {
        /// Metres along +y.
        distance: f64,
        /// What it looks like.
        surface: Surface,
    },
}

/// A cylinder that narrows downwards; its filled top is 1 cm under the plant's base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pot {
    /// Radius of the rim, metres.
    pub radius: f64,
    /// Height, metres.
    pub height: f64,
    /// Linear reflectance.
    pub colour: Vec3,
}

/// A sun and the light from everywhere else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector to the sun.
    pub to_sun: Vec3,
    /// Linear colour of the sun.
    pub sun: Vec3,
    /// Linear colour of the rest.
    pub ambient: Vec3,
}

/// Everything but the plants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// What the plants stand on.
    pub ground: Ground,
    /// What is behind them.
    pub backdrop: Backdrop,
    /// A pot around each plant.
    pub pot: Option<Pot>,
    /// What lights them.
    pub light: Light,
}

impl Setting {
    /// A plain light room with a lamp from above and in front: for pictures of single plants.
    pub const STUDIO: Self = Self {
        ground: Ground { z: 0.0, surface: Surface::Plain { colour: Vec3::splat(0.6) } },
        backdrop: Backdrop::Sky { brightness: 0.8 },
        pot: None,
        light: Light {
            // The unit vector along (0.3, -0.5, 0.8).
            to_sun: Vec3::new(0.303_046, -0.505_076, 0.808_122),
            sun: Vec3::splat(1.2),
            ambient: Vec3::splat(0.6),
        },
    };
}

/// A plant of a scene.
#[derive(Clone, Debug)]
pub struct Standing {
    /// Its parameters: the truth.
    pub plant: Plant,
    /// Its species' name.
    pub species: String,
}

/// How an instance looks; instance 0 is the pots.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    pub semantic: Semantic,
    pub plant: u32,
    pub organ: u32,
    pub colour: Vec3,
    pub vein: f32,
    pub yellow: f32,
    pub gloss: f32,
    pub seed: u32,
}

/// Plants on ground before a backdrop, meshed and lit.
pub struct Scene {
    /// The plants, in order of their instances.
    pub plants: Vec<Standing>,
    /// Everything else.
    pub setting: Setting,
    pub(super) seed: u32,
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Instance of each face.
    pub(super) instances: Vec<u16>,
    pub(super) looks: Vec<Look>,
    pub(super) shadow: Shadow,
}

impl Scene {
    /// Stands plants in a setting; `seed` decides colours and textures.
    ///
    /// # Errors
    /// [`WorldError`] naming the plant at fault, or that there are too many organs.
    pub fn new(
        plants: Vec<(&Species, Plant)>,
        setting: Setting,
        detail: Detail,
        seed: u64,
    ) -> Result<Self, WorldError> {
        let mut rng = seeded(seed);
        let pot = Look {
            semantic: Semantic::Background,
            plant: 0,
            organ: 0,
            colour: setting.pot.map_or(Vec3::ZERO, |pot| pot.colour),
            vein: 0.0,
            yellow: 0.0,
            gloss: 0.05,
            seed: rng.random(),
        };
        let mut scene = Self {
            plants: Vec::with_capacity(plants.len()),
            setting,
            seed: rng.random(),
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            faces: Vec::new(),
            instances: Vec::new(),
            looks: vec![pot],
            shadow: Shadow::none(),
        };
        let variety = Variety::random(&mut rng);
        for (plant, (species, parameters)) in plants.into_iter().enumerate() {
            let posed = forward(&parameters, species).map_err(|error| WorldError::Plant { plant, error })?;
            let first = scene.looks.len();
            let found = first - 1 + parameters.organs.len();
            if found > usize::from(u16::MAX) {
                return Err(WorldError::TooManyOrgans { expected: usize::from(u16::MAX), found });
            }
            let mesh = PlantMesh::of(&posed, detail, Knots::Uniform);
            scene.looks.extend(looks(&parameters, &variety, plant as u32, &mut rng));
            scene.add(&mesh, |face| (first + mesh.organ_of_face[face] as usize) as u16);
            if let Some(pot) = setting.pot {
                let mesh = pot_mesh(pot, parameters.world_from_plant.translation.as_vec3());
                scene.add(&mesh, |_| 0);
            }
            scene.plants.push(Standing { plant: parameters, species: species.name.clone() });
        }
        scene.shadow = Shadow::cast(&scene);
        Ok(scene)
    }

    /// Lowest and highest corner of everything that stands on the ground, metres; zeros when nothing does.
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let plants = || {
            let seen = self.faces.iter().zip(&self.instances).filter(|(_, instance)| **instance > 0);
            seen.flat_map(|(face, _)| face.iter().map(|v| self.positions[*v as usize]))
        };
        match plants().next() {
            None => (Vec3::ZERO, Vec3::ZERO),
            Some(p) => plants().fold((p, p), |(low, high), p| (low.min(p), high.max(p))),
        }
    }

    fn add(&mut self, mesh: &PlantMesh, instance: impl Fn(usize) -> u16) {
        let first = self.positions.len() as u32;
        self.positions.extend(mesh.positions.iter().map(|p| p.as_vec3()));
        self.normals.extend(mesh.normals.iter().map(|n| n.as_vec3()));
        self.uvs.extend(mesh.uvs.iter().map(|uv| uv.as_vec2()));
        self.faces.extend(mesh.faces.iter().map(|face| face.map(|v| v + first)));
        self.instances.extend((0..mesh.faces.len()).map(instance));
    }
}

/// What the plants of one scene share: they are of one variety. Reflectances are about those of green leaves in red,
/// green and blue (a guess from photographs).
struct Variety {
    green: Vec3,
    stem: Vec3,
    /// How far main stems go to purple, 0..=1.
    purple: f32,
    vein: f32,
    gloss: f32,
}

impl Variety {
    fn random(rng: &mut Seeded) -> Self {
        // Yellower greens are also lighter.
        let green = Vec3::new(0.055, 0.15, 0.035).lerp(Vec3::new(0.13, 0.26, 0.045), rng.random());
        let green = green * Vec3::new(shift(rng, 0.15), shift(rng, 0.15), shift(rng, 0.4));
        Self {
            green,
            stem: green.lerp(Vec3::new(0.22, 0.30, 0.11), rng.random_range(0.1..0.8)),
            purple: if rng.random_bool(0.25) { rng.random_range(0.0..0.8) } else { 0.0 },
            vein: rng.random_range(0.1..0.9),
            gloss: rng.random_range(0.02..0.2),
        }
    }
}

/// A factor around 1.
fn shift(rng: &mut Seeded, by: f32) -> f32 {
    1.0 + by * (2.0 * rng.random::<f32>() - 1.0)
}

/// Colours of a plant's organs: each plant and organ a little different, the lowest leaves sometimes yellow.
fn looks(plant: &Plant, variety: &Variety, index: u32, rng: &mut Seeded) -> Vec<Look> {
    let own = Vec3::new(shift(rng, 0.12), shift(rng, 0.1), shift(rng, 0.12));
    let yellow = if rng.random_bool(0.3) { rng.random_range(0.0..0.9) } else { 0.0 };
    let organs = plant.organs.iter().enumerate().map(|(organ, parameters)| {
        let (semantic, colour) = match parameters.kind() {
            OrganKind::MainStem => (Semantic::MainStem, variety.stem.lerp(Vec3::new(0.13, 0.04, 0.05), variety.purple)),
            OrganKind::Stem => (Semantic::Stem, variety.stem),
            OrganKind::Leaf => (Semantic::Leaf, variety.green),
        };
        let low = 1.0 - organ as f32 / plant.organs.len() as f32;
        let spots: f32 = rng.random();
        Look {
            semantic,
            plant: index,
            organ: organ as u32,
            colour: colour * own * shift(rng, 0.2),
            vein: variety.vein,
            yellow: yellow * low * low * spots,
            gloss: variety.gloss,
            seed: rng.random(),
        }
    });
    organs.collect()
}

fn pot_mesh(pot: Pot, at: Vec3) -> PlantMesh {
    /// Sides of a pot.
    const SIDES: u32 = 24;
    let mut mesh = PlantMesh::default();
    let (r, h) = (pot.radius, pot.height);
    // Profile from the filling outwards, over the rim and down: radius, height, and the normal's radius and height.
    let profile = [
        (0.0, -0.01, 0.0, 1.0),
        (0.92 * r, -0.01, 0.0, 1.0),
        (0.92 * r, 0.01, -1.0, 0.0),
        (r, 0.01, 0.0, 1.0),
        (r, 0.0, 1.0, 0.0),
        (0.8 * r, -h, 1.0, 0.0),
    ];
    for (radius, z, out, up) in profile {
        for k in 0..SIDES {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(SIDES)).sin_cos();
            mesh.positions.push(at.as_dvec3() + glam::DVec3::new(radius * cos, radius * sin, z));
            mesh.normals.push(glam::DVec3::new(out * cos, out * sin, up));
            mesh.uvs.push(glam::DVec2::new(radius, z));
        }
    }
    for ring in 0..profile.len() as u32 - 1 {
        for k in 0..SIDES {
            let (a, b) = (ring * SIDES + k, ring * SIDES + (k + 1) % SIDES);
            mesh.faces.extend([[a, a + SIDES, b + SIDES], [a, b + SIDES, b]]);
        }
    }
    mesh
}
