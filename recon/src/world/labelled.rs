use glam::DVec3;
use rand::Rng;

use super::Seeded;
use super::sprout::normal;
use crate::cloud::PointCloud;
use crate::metrics::sample_surface;
use crate::model::{Detail, Knots, OrganKind, Plant, PlantError, PlantMesh, Species, forward};

/// Points on a plant with their truth.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledCloud {
    /// Points with labels: 0 = stems, 1.. one a blade in order of the organs.
    pub cloud: PointCloud,
    /// Index of each point's organ in the plant.
    pub organ: Vec<u32>,
}

/// `count` points drawn evenly by area from the plant's surface, moved by `noise` metres (standard deviation).
///
/// # Errors
/// [`PlantError`] when the plant is none.
pub fn labelled_cloud(
    plant: &Plant,
    species: &Species,
    count: usize,
    noise: f64,
    rng: &mut Seeded,
) -> Result<LabelledCloud, PlantError> {
    let mesh = PlantMesh::of(&forward(plant, species)?, Detail::Control, Knots::Uniform);
    let mut blades = 0;
    let label_of: Vec<i32> = plant
        .organs
        .iter()
        .map(|organ| {
            if organ.kind() == OrganKind::Leaf {
                blades += 1;
                blades
            } else {
                0
            }
        })
        .collect();
    let (mut points, mut labels, mut organs) = (Vec::new(), Vec::new(), Vec::new());
    for (point, face) in sample_surface(&mesh, count, rng.random()) {
        points.push(point + DVec3::new(normal(rng), normal(rng), normal(rng)) * noise);
        let organ = mesh.organ_of_face[face];
        labels.push(label_of[organ as usize]);
        organs.push(organ);
    }
    Ok(LabelledCloud { cloud: PointCloud { points, labels: Some(labels), ..PointCloud::default() }, organ: organs })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::{grow, seeded};

    #[test]
    fn points_fall_by_area_and_labels_follow_organs() {
        let species = crate::species::shipped("soybean").expect("listed").expect("valid");
        let plant = grow(&species, 0.4, &mut seeded(4));
        let cloud = labelled_cloud(&plant, &species, 20_000, 0.0, &mut seeded(1)).expect("valid");
        let mesh = PlantMesh::of(&forward(&plant, &species).expect("valid"), Detail::Control, Knots::Uniform);
        let total: f64 = (0..mesh.faces.len()).map(|f| mesh.face_area(f)).sum();
        let labels = cloud.cloud.labels.expect("labelled");
        for (organ, parameters) in plant.organs.iter().enumerate() {
            let faces = (0..mesh.faces.len()).filter(|f| mesh.organ_of_face[*f] as usize == organ);
            let share = faces.map(|f| mesh.face_area(f)).sum::<f64>() / total;
            let of_organ: Vec<i32> =
                cloud.organ.iter().zip(&labels).filter(|(o, _)| **o as usize == organ).map(|(_, l)| *l).collect();
            // Five standard deviations of a binomial count.
            let bound = 5.0 * (share * (1.0 - share) / 20_000.0).sqrt() + 1e-4;
            assert!((of_organ.len() as f64 / 20_000.0 - share).abs() < bound, "organ {organ}");
            let leaf = parameters.kind() == OrganKind::Leaf;
            assert!(of_organ.iter().all(|l| (*l > 0) == leaf && *l == of_organ[0]), "organ {organ}");
        }
    }
}
