//! Points as they come from scans or lifted views.

use glam::DVec3;

use crate::model::OrganKind;

/// A point cloud in metres, z up unless its source said otherwise and was turned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Positions, metres.
    pub points: Vec<DVec3>,
    /// 8-bit R, G, B, one a point, when the source has colour.
    pub colours: Option<Vec<[u8; 3]>>,
    /// Organ labels, one a point, when the source has them: 0 = stems, 1.. = one leaf node each.
    pub labels: Option<Vec<i32>>,
    /// Organs with their kinds, one a point, when the source has every organ apart, stems too.
    pub organs: Option<Vec<PointOrgan>>,
}

/// Which organ a point belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointOrgan {
    /// A number of the organ's own, negative for none; the PLY property `organ`.
    pub organ: i32,
    /// Its kind; the PLY property `kind`: 0 main stem, 1 stem or petiole, 2 leaf.
    pub kind: OrganKind,
}

/// Diagonal of the points' axis-aligned bounding box in metres, `None` without points.
#[must_use]
pub fn diagonal(points: &[DVec3]) -> Option<f64> {
    let low = points.iter().copied().reduce(DVec3::min)?;
    let high = points.iter().copied().reduce(DVec3::max)?;
    Some(low.distance(high))
}

/// At most `most` of the points, one of each run of neighbours in storage, at a place in the run that jumps from run to
/// run: scans are stored row by row, and every k-th point of a row may be the same stripe of the plant.
#[must_use]
pub fn thinned(points: &[DVec3], most: usize) -> Vec<DVec3> {
    let run = points.len().div_ceil(most.max(1)).max(1);
    // Multiples of the golden ratio fall evenly into the runs and repeat no pattern.
    let jump = |i: usize, len: usize| ((i as f64 * 0.618_033_988_749_895).fract() * len as f64) as usize;
    points.chunks(run).enumerate().map(|(i, run)| run[jump(i, run.len())]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_a_raster_keeps_all_of_its_columns() {
        // Rows of 100 points: every 100th would be one column.
        let raster: Vec<DVec3> =
            (0..100_000).map(|i| DVec3::new(f64::from(i % 100), f64::from(i / 100), 0.0)).collect();
        let few = thinned(&raster, 1_000);
        assert_eq!(few.len(), 1_000);
        for tenth in 0..10 {
            let inside = few.iter().filter(|p| (p.x as usize) / 10 == tenth).count();
            assert!((90..=110).contains(&inside), "columns {tenth}0 to {tenth}9: {inside}");
        }
        assert_eq!(thinned(&raster[..7], 7), raster[..7]);
        assert!(thinned(&[], 3).is_empty() && thinned(&raster[..7], 3).len() <= 3);
    }
}
