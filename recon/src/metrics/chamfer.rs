//! Chamfer distance between a cloud and a surface.

use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::cloud::diagonal;
use crate::model::PlantMesh;
use crate::nearest::Nearest;

/// Surface samples of the Chamfer distance; the release's own number.
pub const SURFACE_SAMPLES: usize = 50_000;
/// Seed of those samples; any fixed number, so that equal meshes score equally.
const SEED: u64 = 0;

/// Chamfer distance, each number divided by the diagonal of the cloud's axis-aligned bounding box.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Chamfer {
    /// Mean of the two directions: the CD of every table.
    pub cd: f64,
    /// Mean distance from a point of the cloud to the nearest surface sample.
    pub cloud_to_surface: f64,
    /// Mean distance from a surface sample to the nearest point of the cloud.
    pub surface_to_cloud: f64,
}

/// The Chamfer distance between a cloud and a surface, from 50,000 area-uniform surface samples.
///
/// `None` when there is nothing to compare: no finite point, a cloud without extent, a mesh without area. Points
/// that are not finite are left out.
#[must_use]
pub fn chamfer(cloud: &[DVec3], mesh: &PlantMesh) -> Option<Chamfer> {
    rough_chamfer(cloud, mesh, SURFACE_SAMPLES)
}

/// The same from fewer surface samples: for searches that need it often. It is no figure to report.
#[must_use]
pub fn rough_chamfer(cloud: &[DVec3], mesh: &PlantMesh, samples: usize) -> Option<Chamfer> {
    let cloud: Vec<DVec3> = cloud.iter().copied().filter(|p| p.is_finite()).collect();
    let diagonal = diagonal(&cloud).filter(|d| *d > 0.0)?;
    let surface: Vec<DVec3> = sample_surface(mesh, samples, SEED).into_iter().map(|(p, _)| p).collect();
    let cloud_to_surface = mean_distance(&cloud, &surface)? / diagonal;
    let surface_to_cloud = mean_distance(&surface, &cloud)? / diagonal;
    Some(Chamfer { cd: (cloud_to_surface + surface_to_cloud) / 2.0, cloud_to_surface, surface_to_cloud })
}

/// Mean distance in metres from each of `from` to the nearest of `to`; `None` when either is empty.
fn mean_distance(from: &[DVec3], to: &[DVec3]) -> Option<f64> {
    let search = Nearest::of(to);
    let total = from.iter().map(|p| Some(search.one(*p)?.distance())).sum::<Option<f64>>()?;
    (!from.is_empty()).then(|| total / from.len() as f64)
}

/// `count` points drawn uniformly by area with the face of each; none when the mesh has no area.
#[must_use]
pub fn sample_surface(mesh: &PlantMesh, count: usize, seed: u64) -> Vec<(DVec3, usize)> {
    let mut total = 0.0;
    // Area of all faces up to and including each.
    let up_to: Vec<f64> = (0..mesh.faces.len())
        .map(|face| {
            total += mesh.face_area(face);
            total
        })
        .collect();
    if !(total > 0.0 && total.is_finite()) {
        return Vec::new();
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let at = random.random::<f64>() * total;
            let face = up_to.partition_point(|area| *area <= at).min(up_to.len() - 1);
            let [a, b, c] = mesh.corners(face);
            // The square root spreads the samples evenly instead of crowding them at a.
            let (root, v) = (random.random::<f64>().sqrt(), random.random::<f64>());
            (a + (b - a) * (root * (1.0 - v)) + (c - a) * (root * v), face)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit square in the plane z = `z`, its second triangle cut in two so that areas differ.
    fn square(z: f64) -> PlantMesh {
        let at = |x: f64, y: f64| DVec3::new(x, y, z);
        PlantMesh {
            positions: vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0), at(0.5, 1.0)],
            faces: vec![[0, 1, 2], [0, 2, 4], [0, 4, 3]],
            organ_of_face: vec![0; 3],
            ..PlantMesh::default()
        }
    }

    #[test]
    fn samples_fall_evenly_on_the_surface() {
        let samples = sample_surface(&square(2.0), 40_000, 7);
        // Four sigma of a binomial share of 40,000 is below 0.01.
        let share = |inside: &dyn Fn(DVec3) -> bool| {
            samples.iter().filter(|(p, _)| inside(*p)).count() as f64 / samples.len() as f64
        };
        for (x, y) in [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)] {
            let found = share(&|p| (x..x + 0.5).contains(&p.x) && (y..y + 0.5).contains(&p.y));
            assert!((found - 0.25).abs() < 0.01, "quarter at {x}, {y}: {found}");
        }
        assert!(samples.iter().all(|(p, _)| p.z == 2.0));
        assert_eq!(samples, sample_surface(&square(2.0), 40_000, 7));
        assert_ne!(samples, sample_surface(&square(2.0), 40_000, 8));
    }

    #[test]
    fn a_shifted_square_is_as_far_as_its_shift() {
        let cloud: Vec<DVec3> = sample_surface(&square(0.0), 20_000, 1).into_iter().map(|(p, _)| p).collect();
        let near = chamfer(&cloud, &square(0.0)).expect("both there");
        // Mean nearest distance of n random points per unit area is 1 / (2 sqrt n), here over a diagonal of sqrt 2.
        assert!(near.cd < 0.5 * 20_000_f64.powf(-0.5), "{near:?}");
        let far = chamfer(&cloud, &square(0.3)).expect("both there");
        let expected = 0.3 / 2_f64.sqrt();
        assert!((far.cloud_to_surface - expected).abs() < 1e-3, "{far:?}");
        assert!((far.surface_to_cloud - expected).abs() < 1e-3, "{far:?}");
        // A cloud of half the plant is explained, the other half of the surface is not.
        let half: Vec<DVec3> = cloud.into_iter().filter(|p| p.x < 0.5).collect();
        let half = chamfer(&half, &square(0.0)).expect("both there");
        assert!(half.surface_to_cloud > 10.0 * half.cloud_to_surface, "{half:?}");
    }

    #[test]
    fn nothing_to_compare_is_none() {
        assert_eq!(chamfer(&[], &square(0.0)), None);
        assert_eq!(chamfer(&[DVec3::NAN], &square(0.0)), None);
        assert_eq!(chamfer(&[DVec3::ONE; 3], &square(0.0)), None);
        assert_eq!(chamfer(&[DVec3::ZERO, DVec3::ONE], &PlantMesh::default()), None);
    }
}
