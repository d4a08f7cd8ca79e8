use demeter_frame::Semantic;
use glam::Vec3;
use rand::Rng;

use super::{LabelledMesh, Seeded};

/// Lets the margins of the model's blades wave, as the strap leaves of maize do whose margins outgrow the midrib: the
/// plant model's 15 bends of a blade know no wave of a few centimetres. `height` is the wave's, as a share of the blade's
/// width (0.1 to 0.4 look like maize; a guess from photographs).
pub(super) fn ripple(mesh: &mut LabelledMesh, height: f32, rng: &mut Seeded) {
    let owned = mesh.vertices_of_organs();
    for (organ, vertices) in mesh.organs.iter().zip(owned) {
        if organ.semantic != Semantic::Leaf {
            continue;
        }
        let waves: f32 = rng.random_range(4.0..9.0);
        let phases: [f32; 2] = [rng.random(), rng.random()];
        // A blade's vertices come row by row from base to tip.
        for row in vertices.chunk_by(|a, b| mesh.uvs[*a as usize].y == mesh.uvs[*b as usize].y) {
            let (first, last) = (row[0] as usize, row[row.len() - 1] as usize);
            let width = mesh.positions[first].distance(mesh.positions[last]);
            for vertex in row {
                let vertex = *vertex as usize;
                let (off, along) = (2.0 * mesh.uvs[vertex].x - 1.0, mesh.uvs[vertex].y);
                let phase = phases[usize::from(off > 0.0)] + waves * along;
                let lift = height * width * off * off * (std::f32::consts::TAU * phase).sin();
                let normal = mesh.normals[vertex];
                mesh.positions[vertex] += normal * lift;
            }
        }
    }
    smooth(mesh);
}

/// Normals anew, of each vertex the mean of its faces' weighted by area; their side stays.
fn smooth(mesh: &mut LabelledMesh) {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
        for v in face {
            sums[*v as usize] += (b - a).cross(c - a);
        }
    }
    for (normal, sum) in mesh.normals.iter_mut().zip(sums) {
        let fresh = sum.normalize_or(*normal);
        *normal = if fresh.dot(*normal) < 0.0 { -fresh } else { fresh };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Detail;
    use crate::world::{grow, seeded};

    #[test]
    fn margins_wave_and_midribs_and_stems_stay() {
        let species = crate::species::shipped("maize").expect("listed").expect("valid");
        let plant = grow(&species, 0.5, &mut seeded(2));
        let calm = LabelledMesh::of(&plant, &species, Detail::Rows).expect("valid");
        let mut wavy = calm.clone();
        ripple(&mut wavy, 0.3, &mut seeded(1));
        let (mut moved, mut margins) = (0, 0);
        for (organ, vertices) in calm.organs.iter().zip(calm.vertices_of_organs()) {
            for v in vertices {
                let v = v as usize;
                let by = calm.positions[v].distance(wavy.positions[v]);
                let margin = organ.semantic == Semantic::Leaf && [0.0, 1.0].contains(&calm.uvs[v].x);
                if margin {
                    margins += 1;
                    moved += usize::from(by > 0.002);
                }
                assert!(by < 0.05, "{by} m");
                assert!(margin || calm.uvs[v].x != 0.5 || by == 0.0, "the midrib moved by {by} m");
                assert!(organ.semantic == Semantic::Leaf || by == 0.0, "a stem moved by {by} m");
                assert!((wavy.normals[v].length() - 1.0).abs() < 1e-3);
            }
        }
        assert!(moved * 2 > margins && margins > 100, "{moved} of {margins}");
    }
}
