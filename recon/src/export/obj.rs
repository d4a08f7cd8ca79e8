//! Wavefront OBJ: text, one group an organ.

use std::fmt::Write as _;

use super::kind_name;
use crate::model::{OrganKind, PlantMesh};

/// A mesh as OBJ in metres, z up, to the micrometre, with texture coordinates and normals; group and material of an
/// organ are `leaf_7` and `leaf`. `kinds` are those of the plant's organs in order.
#[must_use]
pub fn mesh_to_obj(mesh: &PlantMesh, kinds: &[OrganKind]) -> Vec<u8> {
    let mut text = String::from("# metres, z up\no plant\n");
    // Writing to a string cannot fail.
    for p in &mesh.positions {
        _ = writeln!(text, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z);
    }
    for uv in &mesh.uvs {
        _ = writeln!(text, "vt {:.5} {:.5}", uv.x, uv.y);
    }
    for n in &mesh.normals {
        _ = writeln!(text, "vn {:.4} {:.4} {:.4}", n.x, n.y, n.z);
    }
    let mut group = None;
    for (face, organ) in mesh.faces.iter().zip(&mesh.organ_of_face) {
        if group != Some(*organ) {
            group = Some(*organ);
            let kind = kinds.get(*organ as usize).map_or("organ", |kind| kind_name(*kind));
            _ = writeln!(text, "g {kind}_{organ}\nusemtl {kind}");
        }
        let [a, b, c] = face.map(|v| v + 1);
        _ = writeln!(text, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}");
    }
    text.into_bytes()
}
