use std::collections::BTreeMap;
use std::sync::Arc;

use demeter_frame::{Pose, Semantic};
use glam::{Vec2, Vec3};
use safetensors::{Dtype, SafeTensors};

use super::Texture;
use crate::model::{Detail, Knots, OrganKind, Plant, PlantError, PlantMesh, Species, forward};

/// Largest mesh read, vertices: several times the largest that the plant generator makes.
const MAX_VERTICES: usize = 2_000_000;

/// Why bytes hold no labelled mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// Not the container.
    #[error("expected a safetensors file: {0}")]
    Container(#[from] safetensors::SafeTensorError),
    /// A tensor is missing, of another type or shape, or holds what it may not.
    #[error("{tensor}: expected {expected}, found {found}")]
    Tensor {
        /// Which.
        tensor: &'static str,
        /// What a mesh has there.
        expected: String,
        /// What was there.
        found: String,
    },
}

/// A plant from anywhere as triangles that know their organ; metres, z up, standing at the origin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelledMesh {
    /// Vertices, metres.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v downwards. On blades of the plant model u goes across and v from base to tip.
    pub uvs: Vec<Vec2>,
    /// Vertex indices.
    pub faces: Vec<[u32; 3]>,
    /// Organ of each face.
    pub organ_of_face: Vec<u32>,
    /// The organs.
    pub organs: Vec<MeshOrgan>,
}

/// What an organ of a [`LabelledMesh`] is.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshOrgan {
    /// Its class.
    pub semantic: Semantic,
    /// Its picture; where that is transparent there is no organ.
    pub texture: Option<Arc<Texture>>,
}

/// A labelled mesh that stands somewhere.
#[derive(Clone, Debug)]
pub struct StandingMesh {
    /// The plant.
    pub mesh: Arc<LabelledMesh>,
    /// Where it stands.
    pub world_from_mesh: Pose,
    /// Its size, times that of the mesh.
    pub scale: f32,
}

impl LabelledMesh {
    /// The mesh of a plant of the model, without textures.
    ///
    /// # Errors
    /// [`PlantError`] when the plant is none.
    pub fn of(plant: &Plant, species: &Species, detail: Detail) -> Result<Self, PlantError> {
        let mesh = PlantMesh::of(&forward(plant, species)?, detail, Knots::Uniform);
        let semantic = |kind| match kind {
            OrganKind::MainStem => Semantic::MainStem,
            OrganKind::Stem => Semantic::Stem,
            OrganKind::Leaf => Semantic::Leaf,
        };
        Ok(Self {
            positions: mesh.positions.iter().map(|p| p.as_vec3()).collect(),
            normals: mesh.normals.iter().map(|n| n.as_vec3()).collect(),
            uvs: mesh.uvs.iter().map(|uv| uv.as_vec2()).collect(),
            organ_of_face: mesh.organ_of_face,
            faces: mesh.faces,
            organs: plant.organs.iter().map(|o| MeshOrgan { semantic: semantic(o.kind()), texture: None }).collect(),
        })
    }

    /// Reads what tools/helios/meshes.py writes (the format is described there); `texture` finds a texture by name.
    ///
    /// # Errors
    /// [`MeshError`] naming the tensor at fault.
    pub fn from_bytes(bytes: &[u8], texture: impl Fn(&str) -> Option<Arc<Texture>>) -> Result<Self, MeshError> {
        let tensors = SafeTensors::deserialize(bytes)?;
        let (_, metadata) = SafeTensors::read_metadata(bytes)?;
        let names = metadata.metadata().as_ref().and_then(|m| m.get("textures")).cloned().unwrap_or_default();
        let mut textures = Vec::new();
        for name in names.split_whitespace() {
            textures.push(texture(name).ok_or_else(|| wrong("texture", "a texture that is at hand", name))?);
        }
        let floats = |name, width| -> Result<Vec<f32>, MeshError> {
            let floats = tensor(&tensors, name, Dtype::F32, width, f32::from_le_bytes)?;
            if floats.iter().all(|x| x.is_finite()) { Ok(floats) } else { Err(wrong(name, "finite numbers", "others")) }
        };
        let threes = |floats: &[f32]| floats.chunks_exact(3).map(Vec3::from_slice).collect::<Vec<_>>();
        let positions = threes(&floats("positions", 3)?);
        let normals = threes(&floats("normals", 3)?);
        let uvs: Vec<Vec2> = floats("uvs", 2)?.chunks_exact(2).map(Vec2::from_slice).collect();
        if positions.len() > MAX_VERTICES || normals.len() != positions.len() || uvs.len() != positions.len() {
            let found = format!("{}, {} and {}", positions.len(), normals.len(), uvs.len());
            return Err(wrong("positions", "as many normals and uvs, at most 2 million", found));
        }
        let corners = tensor(&tensors, "faces", Dtype::U32, 3, u32::from_le_bytes)?;
        if let Some(corner) = corners.iter().find(|v| **v as usize >= positions.len()) {
            return Err(wrong("faces", format!("vertices below {}", positions.len()), corner));
        }
        let kinds = tensor(&tensors, "kind", Dtype::U8, 1, |[kind]: [u8; 1]| kind)?;
        let pictures = tensor(&tensors, "texture", Dtype::I16, 1, i16::from_le_bytes)?;
        if pictures.len() != kinds.len() {
            return Err(wrong("texture", kinds.len(), pictures.len()));
        }
        let mut organs = Vec::with_capacity(kinds.len());
        for (kind, picture) in kinds.into_iter().zip(pictures) {
            let semantic = Semantic::ALL.into_iter().find(|class| *class as u8 == kind && kind > 0);
            let semantic = semantic.ok_or_else(|| wrong("kind", "1, 2 or 3", kind))?;
            let texture = match usize::try_from(picture) {
                Err(_) => None,
                Ok(k) => Some(textures.get(k).cloned().ok_or_else(|| wrong("texture", textures.len(), picture))?),
            };
            organs.push(MeshOrgan { semantic, texture });
        }
        let organ_of_face: Vec<u32> =
            tensor(&tensors, "organ", Dtype::U16, 1, u16::from_le_bytes)?.into_iter().map(u32::from).collect();
        let faces: Vec<[u32; 3]> = corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        if organ_of_face.len() != faces.len() || organ_of_face.iter().any(|organ| *organ as usize >= organs.len()) {
            return Err(wrong("organ", format!("an organ below {} for each face", organs.len()), organ_of_face.len()));
        }
        Ok(Self { positions, normals, uvs, faces, organ_of_face, organs })
    }

    /// Height of the highest vertex, metres; 0 without any.
    #[must_use]
    pub fn height(&self) -> f32 {
        self.positions.iter().map(|p| p.z).fold(0.0, f32::max)
    }

    /// The same plant with fewer faces, for seeing from afar. Of each blade the vertices in one cube of a third of its
    /// length become the one farthest from the blade's middle, so that it keeps its outline; petioles, thinner than a
    /// pixel there, collapse and go; the main stem stays.
    #[must_use]
    pub(super) fn coarsened(&self) -> Self {
        let mut coarse = self.clone();
        let mut becomes: Vec<u32> = (0..self.positions.len() as u32).collect();
        for (organ, own) in self.organs.iter().zip(self.vertices_of_organs()) {
            if organ.semantic == Semantic::MainStem || own.is_empty() {
                continue;
            }
            let at = |v: u32| self.positions[v as usize];
            let middle = own.iter().map(|v| at(*v)).sum::<Vec3>() / own.len() as f32;
            let reach = own.iter().map(|v| at(*v).distance(middle)).fold(0.0, f32::max);
            let cube = |v: u32| (at(v) / (0.67 * reach).max(1e-6)).floor().as_ivec3().to_array();
            let mut farthest: BTreeMap<[i32; 3], u32> = BTreeMap::new();
            for v in &own {
                let kept = farthest.entry(cube(*v)).or_insert(*v);
                if at(*v).distance(middle) > at(*kept).distance(middle) {
                    *kept = *v;
                }
            }
            for v in own {
                becomes[v as usize] = farthest[&cube(v)];
            }
        }
        let faces = self.faces.iter().map(|face| face.map(|v| becomes[v as usize])).zip(&self.organ_of_face);
        let whole = faces.filter(|([a, b, c], _)| a != b && b != c && c != a);
        (coarse.faces, coarse.organ_of_face) = whole.unzip();
        coarse
    }

    /// The plant without its blades: a leafless stalk.
    #[must_use]
    pub(super) fn leafless(&self) -> Self {
        let stem = |face: &usize| self.organs[self.organ_of_face[*face] as usize].semantic != Semantic::Leaf;
        let kept: Vec<usize> = (0..self.faces.len()).filter(stem).collect();
        Self {
            faces: kept.iter().map(|face| self.faces[*face]).collect(),
            organ_of_face: kept.iter().map(|face| self.organ_of_face[*face]).collect(),
            ..self.clone()
        }
    }

    /// The vertices of each organ, by the faces that name them.
    pub(super) fn vertices_of_organs(&self) -> Vec<Vec<u32>> {
        let mut vertices = vec![Vec::new(); self.organs.len()];
        for (face, organ) in self.faces.iter().zip(&self.organ_of_face) {
            vertices[*organ as usize].extend(face);
        }
        for own in &mut vertices {
            own.sort_unstable();
            own.dedup();
        }
        vertices
    }
}

/// The elements of a little-endian tensor [n, width], or [n] for a width of 1.
fn tensor<T, const N: usize>(
    tensors: &SafeTensors<'_>,
    name: &'static str,
    dtype: Dtype,
    width: usize,
    element: impl Fn([u8; N]) -> T,
) -> Result<Vec<T>, MeshError> {
    let view = tensors.tensor(name)?;
    let fits = view.dtype() == dtype
        && match view.shape() {
            [_] => width == 1,
            [_, columns] => *columns == width && width > 1,
            _ => false,
        };
    if !fits {
        let expected = if width == 1 { format!("{dtype:?} [n]") } else { format!("{dtype:?} [n, {width}]") };
        return Err(wrong(name, expected, format!("{:?} {:?}", view.dtype(), view.shape())));
    }
    Ok(view.data().as_chunks::<N>().0.iter().map(|bytes| element(*bytes)).collect())
}

fn wrong(tensor: &'static str, expected: impl ToString, found: impl ToString) -> MeshError {
    MeshError::Tensor { tensor, expected: expected.to_string(), found: found.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::tensor::TensorView;

    /// Two triangles: a stem without and a leaf with a texture.
    fn bytes(corner: u32, organ: u16, kind: u8, texture: i16, x: f32) -> Vec<u8> {
        let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let positions = floats(&[x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let normals = floats(&[0.0, 1.0, 0.0].repeat(3));
        let uvs = floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        let faces: Vec<u8> = [0, 1, 2, 2, 1, corner].iter().flat_map(|v: &u32| v.to_le_bytes()).collect();
        let organs: Vec<u8> = [0, organ].iter().flat_map(|v: &u16| v.to_le_bytes()).collect();
        let kinds = [3, kind];
        let textures: Vec<u8> = [-1, texture].iter().flat_map(|v: &i16| v.to_le_bytes()).collect();
        let view = |dtype, shape: &[usize], data| TensorView::new(dtype, shape.to_vec(), data).expect("fits");
        let tensors = [
            ("positions", view(Dtype::F32, &[3, 3], &positions)),
            ("normals", view(Dtype::F32, &[3, 3], &normals)),
            ("uvs", view(Dtype::F32, &[3, 2], &uvs)),
            ("faces", view(Dtype::U32, &[2, 3], &faces)),
            ("organ", view(Dtype::U16, &[2], &organs)),
            ("kind", view(Dtype::U8, &[2], &kinds)),
            ("texture", view(Dtype::I16, &[2], &textures)),
        ];
        let metadata = [("textures".to_owned(), "leaf.png".to_owned())].into();
        safetensors::serialize(tensors, Some(metadata)).expect("fits")
    }

    fn read(bytes: &[u8]) -> Result<LabelledMesh, MeshError> {
        let leaf = Texture::new(&image::RgbaImage::from_pixel(1, 1, image::Rgba([0, 99, 0, 255])));
        LabelledMesh::from_bytes(bytes, |name| leaf.clone().map(Arc::new).filter(|_| name == "leaf.png"))
    }

    #[test]
    fn what_was_written_is_read_and_whatever_is_wrong_is_named() {
        let mesh = read(&bytes(0, 1, 1, 0, 0.5)).expect("valid");
        assert_eq!(mesh.positions[0], Vec3::new(0.5, 0.0, 0.0));
        assert_eq!((mesh.faces.len(), &mesh.organ_of_face[..], mesh.height()), (2, &[0, 1][..], 1.0));
        assert_eq!(mesh.organs.iter().map(|o| o.semantic).collect::<Vec<_>>(), [Semantic::MainStem, Semantic::Leaf]);
        assert!(mesh.organs[0].texture.is_none() && mesh.organs[1].texture.is_some());
        for (tensor, wrong) in [
            ("faces", bytes(3, 1, 1, 0, 0.0)),
            ("organ", bytes(0, 2, 1, 0, 0.0)),
            ("kind", bytes(0, 1, 0, 0, 0.0)),
            ("kind", bytes(0, 1, 4, 0, 0.0)),
            ("texture", bytes(0, 1, 1, 1, 0.0)),
            ("positions", bytes(0, 1, 1, 0, f32::NAN)),
        ] {
            let error = read(&wrong).expect_err(tensor).to_string();
            assert!(error.starts_with(tensor), "{error}");
        }
        assert!(LabelledMesh::from_bytes(&bytes(0, 1, 1, 0, 0.0), |_| None).is_err(), "a texture that is not at hand");
        let whole = bytes(0, 1, 1, 0, 0.0);
        assert!((0..whole.len()).all(|end| read(&whole[..end]).is_err()));
    }

    #[test]
    fn far_plants_keep_their_blades_area_and_lose_faces_and_stalks_lose_blades() {
        let species = crate::species::shipped("soybean").expect("listed").expect("valid");
        let plant = crate::world::grow(&species, 0.5, &mut crate::world::seeded(3));
        let mesh = LabelledMesh::of(&plant, &species, Detail::Rows).expect("valid");
        let far = mesh.coarsened();
        assert_eq!(far.organs, mesh.organs);
        assert!(far.faces.len() * 4 < mesh.faces.len(), "{} of {}", far.faces.len(), mesh.faces.len());
        let area = |mesh: &LabelledMesh, of: Semantic| -> f32 {
            let faces = mesh.faces.iter().zip(&mesh.organ_of_face);
            let own = faces.filter(|(_, organ)| mesh.organs[**organ as usize].semantic == of);
            own.map(|(f, _)| {
                let [a, b, c] = f.map(|v| mesh.positions[v as usize]);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
        };
        let kept = area(&far, Semantic::Leaf) / area(&mesh, Semantic::Leaf);
        assert!((0.7..1.1).contains(&kept), "of the leaves' area {kept} is left");
        assert_eq!(area(&far, Semantic::MainStem), area(&mesh, Semantic::MainStem));
        let stalk = mesh.leafless();
        assert_eq!((area(&stalk, Semantic::Leaf), area(&stalk, Semantic::Stem)), (0.0, area(&mesh, Semantic::Stem)));
    }
}
