//! SimpleProc: one procedural plant of eight global parameters, fitted by Bayesian optimisation of the Chamfer distance
//! (paper Tab. 1 and supp.; the idea only, our own grammar).

use glam::DVec3;

use super::grammar::{Genome, draw};
use super::search::minimise;
use crate::cloud::thinned;
use crate::metrics::rough_chamfer;
use crate::model::{Habit, PlantMesh};

/// Numbers that describe the whole plant.
pub const PARAMETERS: usize = 8;
/// Points and surface samples that steer the search; the table's figure is the full Chamfer distance.
const STEERING: usize = 2_000;
/// Share of the points, lowest first, whose middle is the plant's foot.
const FOOT_SHARE: f64 = 0.01;

/// The procedural plant nearest to a cloud; `up` is the unit vertical. Empty without points.
#[must_use]
pub fn simple_proc(cloud: &[DVec3], habit: Habit, up: DVec3) -> PlantMesh {
    let mut by_height = cloud.to_vec();
    by_height.sort_by(|a, b| a.dot(up).total_cmp(&b.dot(up)));
    let (Some(low), Some(high)) = (by_height.first(), by_height.last()) else { return PlantMesh::default() };
    let height = (high.dot(up) - low.dot(up)).max(f64::MIN_POSITIVE);
    let foot = &by_height[..((by_height.len() as f64 * FOOT_SHARE) as usize).max(1)];
    let base = foot.iter().sum::<DVec3>() / foot.len() as f64;
    let few = thinned(cloud, STEERING);
    let plant = |x: &[f64; PARAMETERS]| draw(&genome(x, height), habit, base, up);
    let (best, _) = minimise(0, |x| rough_chamfer(&few, &plant(x), STEERING).map_or(f64::INFINITY, |found| found.cd));
    plant(&best)
}

/// The parameters' ranges: lengths as shares of the cloud's height, wide enough for seedlings and grasses.
fn genome(x: &[f64; PARAMETERS], height: f64) -> Genome {
    let between = |k: usize, low: f64, high: f64| low + (high - low) * x[k];
    Genome {
        stem: height * between(0, 0.1, 1.0),
        nodes: between(1, 1.0, 20.99) as usize,
        petiole: height * between(2, 0.0, 0.6),
        angle: between(3, 0.1, 1.7),
        blade: height * between(4, 0.05, 1.2),
        width: between(5, 0.03, 0.9),
        droop: between(6, -0.5, 2.0),
        divergence: between(7, std::f64::consts::FRAC_PI_2, std::f64::consts::PI),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::sample_surface;

    #[test]
    fn its_own_plant_is_found_nearly_again() {
        let truth = genome(&[0.8, 0.2, 0.4, 0.5, 0.3, 0.5, 0.4, 0.9], 0.5);
        let mesh = draw(&truth, Habit::Simple, DVec3::new(0.2, 0.1, 0.0), DVec3::Z);
        let cloud: Vec<DVec3> = sample_surface(&mesh, 3_000, 3).into_iter().map(|(p, _)| p).collect();
        let found = rough_chamfer(&cloud, &simple_proc(&cloud, Habit::Simple, DVec3::Z), 3_000).unwrap();
        assert!(found.cd < 0.05, "{found:?}");
        assert!(simple_proc(&[], Habit::Simple, DVec3::Z).faces.is_empty());
    }
}
