//! Stems that run beside each other. A petiole that leaves its stem at a small angle is in the same levels of the
//! skeleton as the stem at first; from where it is alone it can be followed back.

use glam::DVec3;

use crate::nearest::Nearest;

/// Length of a step back, in grains.
const STEP: f64 = 2.0;
/// Farthest point from a stem's way that is on it, in grains (a guess: from 0.5 to 1.4 the fits of a scanned and of grown
/// soybeans differ by a tenth, this being among the best).
const REACH: f64 = 0.7;
/// Steps in a row without a point that end a way: sparse scans have gaps.
const GAPS: usize = 2;
/// Weight of the way so far beside that of the newest step.
const INERTIA: f64 = 3.0;

/// A stem where it is alone.
pub(super) struct Track {
    pub organ: usize,
    /// The organ that has its first points.
    pub carrier: usize,
    pub at: DVec3,
    /// Unit vector towards its base.
    pub way: DVec3,
}

impl Track {
    /// Gives the organ the points on its way back that its carrier has, for as long as the carrier has others beside
    /// them in the same nodes, which `beside` lists for a point; `owner` holds the organ of each point.
    pub(super) fn follow<'a>(
        self,
        points: &[DVec3],
        search: &Nearest,
        grain: f64,
        beside: impl Fn(usize) -> &'a [usize],
        owner: &mut [usize],
    ) {
        let Self { organ, carrier, mut at, mut way } = self;
        let (step, reach) = (STEP * grain, REACH * grain);
        let mut gaps = 0;
        // Each step without a gap takes points, of which there are only so many.
        while gaps < GAPS {
            // A little of the step before belongs to each: points at its end are on neither side for certain.
            let around = search.within(at + way * (step / 4.0), 0.75 * step + reach).into_iter().map(|n| n.index);
            let away = |i: usize| (points[i] - at).reject_from(way).length();
            let on_way = |i: &usize| {
                let along = (points[*i] - at).dot(way);
                owner[*i] == carrier && (-step / 2.0..=step).contains(&along) && away(*i) < reach
            };
            let taken: Vec<usize> = around.filter(on_way).collect();
            let is_other = |i: &usize| owner[*i] == carrier && away(*i) >= reach;
            if !taken.is_empty() && !taken.iter().any(|i| beside(*i).iter().any(is_other)) {
                break;
            }
            let next = at + way * step;
            if taken.is_empty() {
                (at, gaps) = (next, gaps + 1);
                continue;
            }
            gaps = 0;
            taken.iter().for_each(|i| owner[*i] = organ);
            let centre = taken.iter().map(|i| points[*i]).sum::<DVec3>() / taken.len() as f64;
            way = (way * INERTIA + (centre - at).normalize_or(way)).normalize_or(way);
            at = centre + way * (next - centre).dot(way).max(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_petiole_beside_its_stem_gets_its_points_back_and_the_stem_keeps_its_own() {
        // A stem along z and a petiole that leaves it at 10°, a point each centimetre; they part 10 cm up.
        let way = DVec3::new(10.0_f64.to_radians().sin(), 0.0, 10.0_f64.to_radians().cos());
        let stem = (0..60).map(|i| DVec3::Z * (0.01 * f64::from(i)));
        let petiole = (1..40).map(|i| DVec3::Z * 0.1 + way * (0.01 * f64::from(i)));
        let points: Vec<DVec3> = stem.chain(petiole).collect();
        // As the skeleton has it: the petiole is alone from 20 cm on.
        let alone = |i: usize| i >= 60 + 20;
        let mut owner: Vec<usize> = (0..points.len()).map(|i| usize::from(alone(i))).collect();
        let track = Track { organ: 1, carrier: 0, at: points[60 + 20], way: -way };
        let level = |i: usize| (points[i].z / 0.03) as usize;
        let levels: Vec<Vec<usize>> = (0..21).map(|k| (0..points.len()).filter(|i| level(*i) == k).collect()).collect();
        track.follow(&points, &Nearest::of(&points), 0.015, |i| &levels[level(i)], &mut owner);
        // Nearer than a grain nobody can tell the two.
        for (i, p) in points.iter().enumerate().filter(|(_, p)| p.z > 0.2) {
            assert_eq!(owner[i], usize::from(i >= 60), "point {i} at {p}");
        }
        assert_eq!(owner[..10], [0; 10], "below the fork all is the stem's");
        assert_eq!(owner[65..80], [1; 15], "the petiole goes back to its fork");
    }
}
