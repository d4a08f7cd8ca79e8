use std::borrow::Cow;

use glam::{Quat, Vec2, Vec3};
use rand::Rng;

use super::look::{Look, Variety, looks};
use super::shadow::Shadow;
use super::{Backdrop, LabelledMesh, Light, Pot, Shade, StandingMesh, Surface, Texture, seeded};
use crate::model::{Detail, Plant, PlantError, Species};

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
    /// What is not seen and throws its shadow on them.
    pub shade: Option<Shade>,
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
        shade: None,
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

/// Plants on ground before a backdrop, meshed and lit.
pub struct Scene {
    /// The plants of the model, in order of their instances; empty in a scene of labelled meshes.
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
        let mut meshes = Vec::with_capacity(plants.len());
        for (index, (species, plant)) in plants.iter().enumerate() {
            let error = |error| WorldError::Plant { plant: index, error };
            let mesh = LabelledMesh::of(plant, species, detail).map_err(error)?;
            let foot = plant.world_from_plant.translation.as_vec3();
            meshes.push(Placed {
                mesh: Cow::Owned(mesh),
                rotation: Quat::IDENTITY,
                offset: Vec3::ZERO,
                scale: 1.0,
                foot,
            });
        }
        let mut scene = Self::placed(&meshes, setting, seed)?;
        let standing = |(species, plant): (&Species, Plant)| Standing { plant, species: species.name.clone() };
        scene.plants = plants.into_iter().map(standing).collect();
        Ok(scene)
    }

    /// Stands labelled meshes in a setting; `seed` decides colours.
    ///
    /// # Errors
    /// [`WorldError::TooManyOrgans`].
    pub fn of_meshes(meshes: &[StandingMesh], setting: Setting, seed: u64) -> Result<Self, WorldError> {
        Self::placed(&meshes.iter().map(Placed::of).collect::<Vec<_>>(), setting, seed)
    }

    fn placed(meshes: &[Placed<'_>], setting: Setting, seed: u64) -> Result<Self, WorldError> {
        let mut rng = seeded(seed);
        let pot = Look::pot(setting.pot.map_or(Vec3::ZERO, |pot| pot.colour), &mut rng);
        let mut scene = Self {
            plants: Vec::new(),
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
        for (plant, placed) in meshes.iter().enumerate() {
            let first = scene.looks.len();
            let found = first - 1 + placed.mesh.organs.len();
            if found > usize::from(u16::MAX) {
                return Err(WorldError::TooManyOrgans { expected: usize::from(u16::MAX), found });
            }
            scene.looks.extend(looks(&placed.mesh.organs, &variety, plant as u32, &mut rng));
            scene.add(placed, |face| (first + placed.mesh.organ_of_face[face] as usize) as u16);
            if let Some(pot) = setting.pot {
                let mesh = Cow::Owned(pot.mesh(placed.foot));
                let at_home = Placed { mesh, rotation: Quat::IDENTITY, offset: Vec3::ZERO, scale: 1.0, ..*placed };
                scene.add(&at_home, |_| 0);
            }
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

    /// The texture that cuts a face out, and the face's corners in it.
    pub(super) fn cutout(&self, face: usize) -> Option<(&Texture, [Vec2; 3])> {
        let texture = self.looks[usize::from(self.instances[face])].texture.as_deref()?;
        (texture.solid_share() < 1.0).then(|| (texture, self.faces[face].map(|v| self.uvs[v as usize])))
    }

    fn add(&mut self, placed: &Placed<'_>, instance: impl Fn(usize) -> u16) {
        let Placed { mesh, rotation, offset, scale, .. } = placed;
        let first = self.positions.len() as u32;
        self.positions.extend(mesh.positions.iter().map(|p| *rotation * (*p * *scale) + *offset));
        self.normals.extend(mesh.normals.iter().map(|n| *rotation * *n));
        self.uvs.extend(&mesh.uvs);
        self.faces.extend(mesh.faces.iter().map(|face| face.map(|v| v + first)));
        self.instances.extend((0..mesh.faces.len()).map(instance));
    }
}

/// A mesh and where it is put.
struct Placed<'a> {
    mesh: Cow<'a, LabelledMesh>,
    rotation: Quat,
    offset: Vec3,
    scale: f32,
    /// Where its pot stands.
    foot: Vec3,
}

impl<'a> Placed<'a> {
    fn of(standing: &'a StandingMesh) -> Self {
        let offset = standing.world_from_mesh.translation.as_vec3();
        let rotation = standing.world_from_mesh.rotation.as_quat();
        Self { mesh: Cow::Borrowed(&*standing.mesh), rotation, offset, scale: standing.scale, foot: offset }
    }
}
