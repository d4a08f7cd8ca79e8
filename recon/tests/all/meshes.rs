//! Exported meshes, parsed back.

use demeter_recon::cloud::PointCloud;
use demeter_recon::export::{mesh_to_glb, mesh_to_obj, mesh_to_ply};
use demeter_recon::model::{Detail, Knots, Organ, OrganKind, PlantMesh, forward};
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

fn example() -> (PlantMesh, Vec<OrganKind>) {
    let species = crate::common::species("soybean");
    let plant = crate::common::random_plant(&species, 9, 4);
    let kinds: Vec<OrganKind> = plant.organs.iter().map(Organ::kind).collect();
    assert!(kinds.contains(&OrganKind::Leaf) && kinds.contains(&OrganKind::Stem));
    (PlantMesh::of(&forward(&plant, &species).unwrap(), Detail::Coarse, Knots::Uniform), kinds)
}

#[test]
fn ply_holds_vertices_and_the_organ_of_each_face() {
    #[derive(Deserialize)]
    struct Vertex {}
    #[derive(Deserialize)]
    struct Face {
        vertex_indices: Vec<u32>,
        organ: u32,
    }
    #[derive(Deserialize)]
    struct File {
        vertex: Vec<Vertex>,
        face: Vec<Face>,
    }
    let (mesh, _) = example();
    let bytes = mesh_to_ply(&mesh);
    for (read, written) in PointCloud::from_ply(&bytes).unwrap().points.iter().zip(&mesh.positions) {
        assert!(read.distance(*written) < 1e-5);
    }
    let file: File = serde_ply::from_reader(bytes.as_slice()).unwrap();
    assert_eq!(file.vertex.len(), mesh.positions.len());
    assert!(file.face.iter().map(|f| f.organ).eq(mesh.organ_of_face.iter().copied()));
    assert!(file.face.iter().zip(&mesh.faces).all(|(read, written)| read.vertex_indices == written));
}

#[test]
fn obj_has_one_group_an_organ_and_every_vertex() {
    let (mesh, kinds) = example();
    let text = String::from_utf8(mesh_to_obj(&mesh, &kinds)).unwrap();
    let lines = |start: &str| text.lines().filter(|l| l.starts_with(start)).count();
    assert_eq!(lines("v "), mesh.positions.len());
    assert_eq!(lines("vt "), mesh.uvs.len());
    assert_eq!(lines("vn "), mesh.normals.len());
    assert_eq!(lines("f "), mesh.faces.len());
    let groups: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("g ")).collect();
    assert_eq!(groups.len(), kinds.len());
    assert_eq!(groups[0], "main_stem_0");
    let leaf = kinds.iter().position(|k| *k == OrganKind::Leaf).unwrap();
    assert_eq!(groups[leaf], format!("leaf_{leaf}"));
    let vertices: Vec<DVec3> = text
        .lines()
        .filter_map(|l| l.strip_prefix("v "))
        .map(|l| l.split(' ').map(|x| x.parse().unwrap()).collect::<Vec<f64>>())
        .map(|v| DVec3::from_slice(&v))
        .collect();
    assert!(vertices.iter().zip(&mesh.positions).all(|(read, written)| read.distance(*written) < 1e-6));
    let corners = text.lines().filter_map(|l| l.strip_prefix("f ")).flat_map(|l| l.split(' '));
    for (corner, vertex) in corners.zip(mesh.faces.as_flattened()) {
        assert_eq!(corner, format!("{0}/{0}/{0}", vertex + 1));
    }
}

/// A GLB's chunks, after checking what the container promises.
fn chunks(glb: &[u8]) -> (Value, &[u8]) {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(&glb[..4], b"glTF");
    assert_eq!((word(4), word(8)), (2, glb.len()));
    let json = word(12);
    assert_eq!((json % 4, &glb[16..20]), (0, b"JSON".as_slice()));
    let binary = 20 + json;
    assert_eq!((word(binary), &glb[binary + 4..binary + 8]), (glb.len() - binary - 8, b"BIN\0".as_slice()));
    assert_eq!(glb.len() % 4, 0);
    (serde_json::from_slice(&glb[20..binary]).unwrap(), &glb[binary + 8..])
}

fn number(value: &Value) -> usize {
    value.as_u64().unwrap() as usize
}

#[test]
fn glb_is_sound_and_holds_the_same_triangles() {
    let (mesh, kinds) = example();
    let glb = mesh_to_glb(&mesh, &kinds);
    assert_eq!(glb, mesh_to_glb(&mesh, &kinds));
    let (json, buffer) = chunks(&glb);
    assert_eq!(json["asset"]["version"], "2.0");
    assert_eq!(number(&json["buffers"][0]["byteLength"]), buffer.len());
    // The 4-byte words of an accessor, whatever their type.
    let words = |accessor: usize, per: usize| -> Vec<[u8; 4]> {
        let accessor = &json["accessors"][accessor];
        let view = &json["bufferViews"][number(&accessor["bufferView"])];
        assert_eq!(view["byteStride"].as_u64().unwrap_or(4), 4 * per as u64);
        let size = 4 * per * number(&accessor["count"]);
        let offset = number(&accessor["byteOffset"]);
        assert!(offset + size <= number(&view["byteLength"]), "an accessor leaves its view");
        let start = number(&view["byteOffset"]) + offset;
        buffer[start..start + size].as_chunks().0.to_vec()
    };
    let vectors = |accessor: usize| -> Vec<DVec3> {
        let floats: Vec<f64> = words(accessor, 3).into_iter().map(|w| f64::from(f32::from_le_bytes(w))).collect();
        floats.as_chunks().0.iter().map(|p| DVec3::from_array(*p)).collect()
    };
    let nodes = json["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), kinds.len());
    assert_eq!(json["scenes"][0]["nodes"].as_array().unwrap().len(), kinds.len());
    let mut triangles = mesh.faces.iter().zip(&mesh.organ_of_face).enumerate();
    for (organ, node) in nodes.iter().enumerate() {
        assert_eq!(number(&node["extras"]["organ"]), organ);
        assert!(node["name"].as_str().unwrap().ends_with(&format!(" {organ}")));
        let primitive = &json["meshes"][number(&node["mesh"])]["primitives"][0];
        let material = &json["materials"][number(&primitive["material"])];
        assert_eq!(material["doubleSided"], kinds[organ] == OrganKind::Leaf);
        let attribute = |name: &str| number(&primitive["attributes"][name]);
        let positions = vectors(attribute("POSITION"));
        let normals = vectors(attribute("NORMAL"));
        let uvs = words(attribute("TEXCOORD_0"), 2).into_iter().map(f32::from_le_bytes);
        assert_eq!((normals.len(), uvs.clone().count()), (positions.len(), 2 * positions.len()));
        assert!(uvs.clone().all(|x| (0.0..=1.0).contains(&x)));
        assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
        let accessor = &json["accessors"][attribute("POSITION")];
        let low = positions.iter().copied().reduce(DVec3::min).unwrap();
        let high = positions.iter().copied().reduce(DVec3::max).unwrap();
        let extreme = |key: &str| serde_json::from_value::<[f32; 3]>(accessor[key].clone()).unwrap();
        assert_eq!((extreme("min"), extreme("max")), (low.as_vec3().to_array(), high.as_vec3().to_array()));
        let indices: Vec<usize> =
            words(number(&primitive["indices"]), 1).into_iter().map(|w| u32::from_le_bytes(w) as usize).collect();
        for corners in indices.as_chunks::<3>().0 {
            let (face, (vertices, of)) = triangles.next().unwrap();
            assert_eq!(*of as usize, organ, "face {face}");
            for (corner, vertex) in corners.iter().zip(vertices) {
                // y up: (x, y, z) stands as (x, z, -y).
                let p = positions[*corner];
                assert!(DVec3::new(p.x, -p.z, p.y).distance(mesh.positions[*vertex as usize]) < 1e-5);
            }
        }
    }
    assert!(triangles.next().is_none(), "faces are missing");
}
