use std::sync::Arc;

use demeter_frame::Semantic;
use rand::Rng;

use super::ripple::ripple;
use super::{LabelledMesh, Seeded, Texture, WorldError, grow};
use crate::model::{Detail, Habit, Species};

/// Kinds whose leaves all leave at the ground.
const ROSETTES: [&str; 3] = ["sugarbeet", "strawberry", "butterlettuce"];

/// The plants and leaf pictures that training pictures are made of.
///
/// With species alone, blades are drawn. [`Self::add_mesh`] brings plants of another generator, [`Self::add_blade`] the
/// pictures of real leaves for the blades of the species' plants.
#[derive(Default)]
pub struct Nursery {
    species: Vec<Species>,
    meshes: Vec<Sapling>,
    broad_blades: Vec<Arc<Texture>>,
    grass_blades: Vec<Arc<Texture>>,
}

/// A plant that is there already.
struct Sapling {
    kind: String,
    grass: bool,
    mesh: Arc<LabelledMesh>,
    height: f32,
}

/// Plants of one kind and about one age: how a bed of them is sown.
pub(super) struct Bed {
    pub plants: Vec<Arc<LabelledMesh>>,
    /// The same with few faces, for those that are far away.
    pub far: Vec<Arc<LabelledMesh>>,
    /// Height of the highest, metres.
    pub height: f32,
}

/// Which plants are asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    Grass,
    Broad,
    Any,
}

impl Wanted {
    fn is(self, grass: bool) -> bool {
        self == Self::Any || (self == Self::Grass) == grass
    }
}

impl Nursery {
    /// A nursery that grows plants of these species; at least one, or [`super::training_view`] finds no plants.
    #[must_use]
    pub fn new(species: Vec<Species>) -> Self {
        Self { species, ..Self::default() }
    }

    /// Adds a plant of a kind, `maize` say; `grass` tells strap leaves from broad ones. Plants of one leaf are left out.
    pub fn add_mesh(&mut self, kind: &str, grass: bool, mesh: LabelledMesh) {
        let height = mesh.height();
        // A seedling of one leaf is a stick with a flag: no picture of it teaches a plant's shape.
        if mesh.organs.iter().filter(|organ| organ.semantic == Semantic::Leaf).count() < 2 {
            return;
        }
        self.meshes.push(Sapling { kind: kind.to_owned(), grass, mesh: Arc::new(mesh), height });
    }

    /// Adds the picture of a blade, u across and v from base to tip.
    pub fn add_blade(&mut self, grass: bool, picture: Texture) {
        let blades = if grass { &mut self.grass_blades } else { &mut self.broad_blades };
        blades.push(Arc::new(picture));
    }

    /// Up to `count` plants of one kind and about one age; none only where there are neither species nor meshes.
    pub(super) fn bed(&self, wanted: Wanted, count: usize, rng: &mut Seeded) -> Result<Bed, WorldError> {
        let meshes: Vec<&Sapling> = self.meshes.iter().filter(|s| wanted.is(s.grass)).collect();
        let species: Vec<&Species> = self.species.iter().filter(|s| wanted.is(s.habit == Habit::Grass)).collect();
        let plants = if meshes.is_empty() || (!species.is_empty() && rng.random_bool(0.5)) {
            self.grown(&species, count, rng)?
        } else {
            sown(&meshes, count, rng)
        };
        let height = plants.iter().map(|mesh| mesh.height()).fold(0.0, f32::max);
        let far = |mesh: &Arc<LabelledMesh>| Arc::new(mesh.coarsened());
        Ok(Bed { far: plants.iter().map(far).collect(), plants, height })
    }

    /// A rosette of leaves and its height in metres, where the meshes have one.
    pub(super) fn rosette(&self, rng: &mut Seeded) -> Option<(Arc<LabelledMesh>, f32)> {
        let rosettes: Vec<&Sapling> = self.meshes.iter().filter(|s| ROSETTES.contains(&s.kind.as_str())).collect();
        pick(&rosettes, rng).map(|s| (Arc::clone(&s.mesh), s.height))
    }

    fn grown(
        &self,
        species: &[&Species],
        count: usize,
        rng: &mut Seeded,
    ) -> Result<Vec<Arc<LabelledMesh>>, WorldError> {
        if species.is_empty() {
            return Ok(Vec::new());
        }
        let species = species[rng.random_range(0..species.len())];
        let grass = species.habit == Habit::Grass;
        let pictures = self.pictures(grass, rng);
        let age = rng.random::<f64>().powf(1.2);
        let waves = if grass && rng.random_bool(0.7) { rng.random_range(0.05..0.4) } else { 0.0 };
        let mut grow_one = |plant| {
            let parameters = grow(species, age * rng.random_range(0.85..1.15), rng);
            let detail = if waves > 0.0 { Detail::Rows } else { Detail::Coarse };
            let error = |error| WorldError::Plant { plant, error };
            let mut mesh = LabelledMesh::of(&parameters, species, detail).map_err(error)?;
            if waves > 0.0 {
                ripple(&mut mesh, waves, rng);
            }
            for organ in mesh.organs.iter_mut().filter(|organ| organ.semantic == Semantic::Leaf) {
                organ.texture = pick(&pictures, rng).cloned();
            }
            Ok(Arc::new(mesh))
        };
        (0..count.min(3)).map(&mut grow_one).collect()
    }

    /// The leaf pictures of one plant: none at times, else a few; leaves with holes only when insects were there.
    fn pictures(&self, grass: bool, rng: &mut Seeded) -> Vec<Arc<Texture>> {
        let all = if grass { &self.grass_blades } else { &self.broad_blades };
        let eaten = rng.random_bool(0.25);
        let fit: Vec<_> = all.iter().filter(|picture| eaten || picture.solid_share() > 0.99).collect();
        let count = if rng.random_bool(0.3) { 0 } else { rng.random_range(1..5) };
        (0..count).filter_map(|_| pick(&fit, rng).map(|picture| Arc::clone(picture))).collect()
    }
}

fn sown(meshes: &[&Sapling], count: usize, rng: &mut Seeded) -> Vec<Arc<LabelledMesh>> {
    let Some(first) = pick(meshes, rng) else {
        return Vec::new();
    };
    let alike = |s: &&&Sapling| s.kind == first.kind && (s.height / first.height - 1.0).abs() < 0.35;
    let alike: Vec<_> = meshes.iter().filter(alike).collect();
    (0..count).filter_map(|_| pick(&alike, rng).map(|s| Arc::clone(&s.mesh))).collect()
}

fn pick<'a, T>(of: &'a [T], rng: &mut Seeded) -> Option<&'a T> {
    if of.is_empty() { None } else { of.get(rng.random_range(0..of.len())) }
}
