//! Binary little-endian PLY.

use std::fmt::Write as _;

use glam::DVec3;

use crate::cloud::PointCloud;
use crate::model::PlantMesh;

/// A cloud as PLY: `double x y z` (so that reading it back gives the same cloud), `uchar red green blue` and
/// `int label`, `int organ` and `uchar kind` where the cloud has them.
#[must_use]
pub fn cloud_to_ply(cloud: &PointCloud) -> Vec<u8> {
    let mut header = header(cloud.points.len(), "double x,double y,double z");
    if cloud.colours.is_some() {
        properties(&mut header, "uchar red,uchar green,uchar blue");
    }
    if cloud.labels.is_some() {
        properties(&mut header, "int label");
    }
    if cloud.organs.is_some() {
        properties(&mut header, "int organ,uchar kind");
    }
    let mut bytes = finish(header);
    for (i, point) in cloud.points.iter().enumerate() {
        point.to_array().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        if let Some(colours) = &cloud.colours {
            bytes.extend(colours[i]);
        }
        if let Some(labels) = &cloud.labels {
            bytes.extend(labels[i].to_le_bytes());
        }
        if let Some(organs) = &cloud.organs {
            bytes.extend(organs[i].organ.to_le_bytes());
            bytes.push(organs[i].kind as u8);
        }
    }
    bytes
}

/// A mesh as PLY: vertices `float x y z nx ny nz s t`, faces `vertex_indices` and `int organ`.
#[must_use]
pub fn mesh_to_ply(mesh: &PlantMesh) -> Vec<u8> {
    let mut header = header(mesh.positions.len(), "float x,float y,float z,float nx,float ny,float nz,float s,float t");
    // Writing to a string cannot fail.
    _ = writeln!(header, "element face {}", mesh.faces.len());
    properties(&mut header, "list uchar int vertex_indices,int organ");
    let mut bytes = finish(header);
    let mut put = |xs: &[f64]| xs.iter().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
    for ((position, normal), uv) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.uvs) {
        put(&DVec3::to_array(position));
        put(&DVec3::to_array(normal));
        put(&uv.to_array());
    }
    for (face, organ) in mesh.faces.iter().zip(&mesh.organ_of_face) {
        bytes.push(3);
        face.iter().chain([organ]).for_each(|i| bytes.extend(i.to_le_bytes()));
    }
    bytes
}

fn header(vertices: usize, vertex_properties: &str) -> String {
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n");
    properties(&mut header, vertex_properties);
    header
}

fn properties(header: &mut String, types_and_names: &str) {
    for property in types_and_names.split(',') {
        _ = writeln!(header, "property {property}");
    }
}

fn finish(mut header: String) -> Vec<u8> {
    header.push_str("end_header\n");
    header.into_bytes()
}
