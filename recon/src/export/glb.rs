//! glTF 2.0 binary: one named node an organ, so that viewers can pick it.

use serde_json::{Value, json};

use super::kind_name;
use crate::model::{OrganKind, PlantMesh};

/// glTF's numbers for component types and buffer targets.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A mesh as GLB in metres. glTF is y up, so (x, y, z) is written as (x, z, -y). Nodes are named `leaf 7` and carry
/// `extras: {organ, kind}`; leaves have a double-sided material, stems a single-sided one. `kinds` are those of the
/// plant's organs in order; organs without faces have no node.
#[must_use]
pub fn mesh_to_glb(mesh: &PlantMesh, kinds: &[OrganKind]) -> Vec<u8> {
    let mut file = Parts::default();
    let organs = mesh.organ_of_face.iter().max().map_or(0, |last| *last as usize + 1);
    let mut faces_of = vec![Vec::new(); organs];
    for (face, organ) in mesh.faces.iter().zip(&mesh.organ_of_face) {
        faces_of[*organ as usize].push(*face);
    }
    let mut index_in_organ = vec![None; mesh.positions.len()];
    for (organ, faces) in faces_of.iter().enumerate().filter(|(_, faces)| !faces.is_empty()) {
        let mut vertices: Vec<u32> = Vec::new();
        let indices: Vec<u32> = faces
            .iter()
            .flatten()
            .map(|v| {
                *index_in_organ[*v as usize].get_or_insert_with(|| {
                    vertices.push(*v);
                    vertices.len() as u32 - 1
                })
            })
            .collect();
        let kind = kinds.get(organ).copied().unwrap_or(OrganKind::Leaf);
        file.add(mesh, organ, kind, &vertices, &indices);
        // An organ keeps its vertices to itself, yet nothing here depends on it.
        vertices.iter().for_each(|v| index_in_organ[*v as usize] = None);
    }
    file.finish()
}

/// Four buffer views (positions, normals, texture coordinates, indices) and what points into them.
#[derive(Default)]
struct Parts {
    positions: Vec<f32>,
    normals: Vec<f32>,
    uvs: Vec<f32>,
    indices: Vec<u32>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl Parts {
    fn add(&mut self, mesh: &PlantMesh, organ: usize, kind: OrganKind, vertices: &[u32], indices: &[u32]) {
        let y_up = |p: glam::DVec3| [p.x as f32, p.z as f32, -p.y as f32];
        let positions: Vec<[f32; 3]> = vertices.iter().map(|v| y_up(mesh.positions[*v as usize])).collect();
        let extreme = |pick: fn(f32, f32) -> f32| {
            [0, 1, 2].map(|axis| f64::from(positions.iter().map(|p| p[axis]).reduce(pick).unwrap_or(0.0)))
        };
        let first = self.accessors.len();
        let accessor = |view: u32, offset: usize, component: u32, count: usize, shape: &str| json!({"bufferView": view, "byteOffset": offset, "componentType": component, "count": count, "type": shape});
        let mut position = accessor(0, 4 * self.positions.len(), FLOAT, vertices.len(), "VEC3");
        position["min"] = json!(extreme(f32::min));
        position["max"] = json!(extreme(f32::max));
        self.accessors.push(position);
        self.accessors.push(accessor(1, 4 * self.normals.len(), FLOAT, vertices.len(), "VEC3"));
        self.accessors.push(accessor(2, 4 * self.uvs.len(), FLOAT, vertices.len(), "VEC2"));
        self.accessors.push(accessor(3, 4 * self.indices.len(), UNSIGNED_INT, indices.len(), "SCALAR"));
        self.positions.extend(positions.as_flattened());
        self.normals.extend(vertices.iter().flat_map(|v| y_up(mesh.normals[*v as usize])));
        self.uvs.extend(vertices.iter().flat_map(|v| mesh.uvs[*v as usize].as_vec2().to_array()));
        self.indices.extend(indices);
        let name = format!("{} {organ}", kind_name(kind));
        self.nodes.push(json!({
            "name": name, "mesh": self.meshes.len(), "extras": {"organ": organ, "kind": kind_name(kind)}
        }));
        self.meshes.push(json!({"name": name, "primitives": [{
            "attributes": {"POSITION": first, "NORMAL": first + 1, "TEXCOORD_0": first + 2},
            "indices": first + 3,
            "material": usize::from(kind != OrganKind::Leaf),
        }]}));
    }

    fn finish(self) -> Vec<u8> {
        let mut buffer: Vec<u8> = Vec::new();
        let mut views = Vec::new();
        for (floats, stride) in [(&self.positions, 12), (&self.normals, 12), (&self.uvs, 8)] {
            views.push(json!({
                "buffer": 0, "byteOffset": buffer.len(), "byteLength": 4 * floats.len(), "byteStride": stride,
                "target": ARRAY_BUFFER
            }));
            floats.iter().for_each(|x| buffer.extend(x.to_le_bytes()));
        }
        views.push(json!({
            "buffer": 0, "byteOffset": buffer.len(), "byteLength": 4 * self.indices.len(),
            "target": ELEMENT_ARRAY_BUFFER
        }));
        self.indices.iter().for_each(|i| buffer.extend(i.to_le_bytes()));
        let material = |name: &str, colour: [f64; 4], double_sided: bool| {
            json!({"name": name, "doubleSided": double_sided, "pbrMetallicRoughness": {
                "baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.8
            }})
        };
        let json = json!({
            "asset": {"version": "2.0", "generator": "Demeter Field"},
            "scene": 0,
            "scenes": [{"nodes": (0..self.nodes.len()).collect::<Vec<_>>()}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "accessors": self.accessors,
            "bufferViews": views,
            "buffers": [{"byteLength": buffer.len()}],
            // Linear RGB by eye: a green blade, a paler stem.
            "materials": [
                material("leaf", [0.09, 0.27, 0.05, 1.0], true),
                material("stem", [0.22, 0.30, 0.09, 1.0], false),
            ],
        });
        let mut json = json.to_string().into_bytes();
        // Chunks end at multiples of four bytes: JSON is padded with spaces, and the buffer has only 4-byte numbers.
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut glb = Vec::with_capacity(28 + json.len() + buffer.len());
        let word = |x: usize| (x as u32).to_le_bytes();
        glb.extend(b"glTF");
        glb.extend(word(2));
        glb.extend(word(28 + json.len() + buffer.len()));
        glb.extend(word(json.len()));
        glb.extend(b"JSON");
        glb.extend(json);
        glb.extend(word(buffer.len()));
        glb.extend(b"BIN\0");
        glb.extend(buffer);
        glb
    }
}
