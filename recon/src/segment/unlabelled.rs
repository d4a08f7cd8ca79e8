//! Clouds without labels: divided by geometry and, where a network has looked at them, by what it says.

use demeter_frame::PointMaps;
use glam::DVec3;

use super::lattice::one_a_cell;
use super::{Segmented, Up, broadleaf, grass, is_fittable, organ};
use crate::cloud::diagonal;
use crate::model::{Habit, Species};
use crate::nearest::Nearest;
use crate::organs::OrganCloud;

/// Points that are divided; every other goes where the nearest of these goes. More than a blade needs to be a sheet, and
/// so few that noise does not make a thicket of it.
const SEEN: usize = 16_000;
/// The δ of boundaries as a share of the cloud's diagonal (spec/reconstruction.md).
const DELTA_SHARE: f64 = 0.01;
/// Largest distance to another organ in δ: the network cannot tell greater ones.
const FARTHEST: f64 = 4.0;

/// What a network says of each point, as it says it.
pub(super) struct Evidence {
    /// Chance that it is a leaf's.
    pub(super) leaf: Vec<f64>,
    /// Chance that it is the main stem's, if it is a stem's.
    pub(super) main: Vec<f64>,
    /// Distance to the nearest other organ, metres, at most 4 % of the cloud's diagonal.
    pub(super) distance: Vec<f64>,
}

impl Evidence {
    /// The mean chance of some points to be a leaf's.
    pub(super) fn leaf_among(&self, near: &[usize]) -> f64 {
        near.iter().map(|i| self.leaf[*i]).sum::<f64>() / near.len() as f64
    }

    /// What is said of the points `seen`, in their order.
    fn of(maps: &PointMaps, seen: &[usize], delta: f64) -> Self {
        let main = |p: [f32; 3]| f64::from(p[2]) / f64::from(p[1] + p[2]).max(f64::MIN_POSITIVE);
        Self {
            leaf: seen.iter().map(|i| f64::from(maps.probabilities[*i][0])).collect(),
            main: seen.iter().map(|i| main(maps.probabilities[*i])).collect(),
            distance: seen.iter().map(|i| delta * (1.0 / f64::from(maps.boundary[*i])).clamp(1.0, FARTHEST)).collect(),
        }
    }
}

/// Divides a cloud; `maps` has an entry for each of its points.
pub(super) fn segment(points: &[DVec3], maps: Option<&PointMaps>, species: &Species, up: Up) -> Segmented {
    let seen = one_a_cell(points, SEEN);
    let own: Vec<DVec3> = seen.iter().map(|i| points[*i]).collect();
    let delta = DELTA_SHARE * diagonal(points).unwrap_or(0.0);
    let evidence = maps.map(|maps| Evidence::of(maps, &seen, delta));
    let (up, foot) = up.resolve(&own, None);
    let organs = match species.habit {
        Habit::Grass => grass::segment(&own, foot.point, up, evidence.as_ref()),
        Habit::Simple | Habit::Compound => broadleaf::segment(&own, foot.point, up, species, evidence.as_ref()),
    };
    let organs = if own.len() == points.len() { organs } else { carried(points, &own, &organs) };
    Segmented { organs: organs.into_iter().filter(is_fittable).collect(), up }
}

/// The organs of all points: each goes where the nearest of `own` does.
fn carried(points: &[DVec3], own: &[DVec3], organs: &[OrganCloud]) -> Vec<OrganCloud> {
    let search = Nearest::of(own);
    let mut owner = vec![None; own.len()];
    for (k, organ) in organs.iter().enumerate() {
        organ.source.iter().for_each(|i| owner[*i as usize] = Some(k));
    }
    let mut members = vec![Vec::new(); organs.len()];
    for (i, p) in points.iter().enumerate() {
        if let Some(k) = search.one(*p).and_then(|n| owner[n.index]) {
            members[k].push(i);
        }
    }
    organs.iter().zip(members).map(|(o, members)| organ(points, o.kind, members)).collect()
}
