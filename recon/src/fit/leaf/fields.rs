//! How a blade's traits change with its surface: gradients by its control points, on any lattice.

use glam::DVec3;

use super::sheet::Sheet;
use crate::polyline::path_length;
use crate::traits::keys;

/// Derivative of a trait by nodes of a sheet, per metre; nodes may repeat.
pub(super) type Field = Vec<(usize, DVec3)>;

/// A trait with its fields. Where there are several, they are directions of equal right and their variances average.
pub(super) type TraitFields = (&'static str, Vec<Field>);

/// Fields of the traits of a blade in a world whose unit vertical is `up`; those without a value are left out.
pub(super) fn of(sheet: &Sheet, up: DVec3) -> Vec<TraitFields> {
    let lattice = sheet.lattice;
    let (rows, columns) = (lattice.rows(), lattice.columns());
    let vein: Vec<usize> = (0..rows).map(|i| lattice.node(i, columns / 2)).collect();
    let widest = (1..rows - 1)
        .map(|i| (0..columns).map(|j| lattice.node(i, j)).collect::<Vec<_>>())
        .max_by(|a, b| length(sheet, a).total_cmp(&length(sheet, b)))
        .unwrap_or_default();
    let mut fields = vec![
        (keys::LEAF_AREA, vec![faces(sheet, |normal| normal.normalize_or_zero())]),
        (keys::LEAF_LENGTH, vec![along(sheet, &vein)]),
        (keys::LEAF_WIDTH, vec![along(sheet, &widest)]),
        (keys::LEAF_CURVATURE, vec![curvature(sheet, &vein)]),
    ];
    let total = normal(sheet);
    let leaning = up.reject_from(total).try_normalize().or(total.try_normalize().map(|n| n.any_orthonormal_vector()));
    if let Some(leaning) = leaning {
        let turn = -leaning * total.dot(up).signum() / total.length();
        fields.push((keys::LEAF_INCLINATION, vec![faces(sheet, |_| turn)]));
    }
    let chord = sheet.points[vein[rows - 1]] - sheet.points[vein[0]];
    let level = chord.reject_from(up);
    if level.length() > 1e-3 * chord.length() {
        let aside = up.cross(level) / level.length_squared();
        fields.push((keys::LEAF_AZIMUTH, vec![vec![(vein[rows - 1], aside), (vein[0], -aside)]]));
    }
    let quarter = sheet.points[vein[rows / 4]] - sheet.points[vein[0]];
    if let Some(leaving) = quarter.try_normalize() {
        // The stem's direction is not known here, so any way of turning counts alike.
        let (one, other) = leaving.any_orthonormal_pair();
        let turn =
            |aside: DVec3| vec![(vein[rows / 4], aside / quarter.length()), (vein[0], -aside / quarter.length())];
        fields.push((keys::LEAF_INSERTION_ANGLE, vec![turn(one), turn(other)]));
    }
    fields
}

/// The two triangles of each cell.
fn triangles(sheet: &Sheet) -> impl Iterator<Item = [usize; 3]> + '_ {
    let lattice = sheet.lattice;
    (0..lattice.rows() - 1).flat_map(move |i| {
        (0..lattice.columns() - 1).flat_map(move |j| {
            let [a, b] = [lattice.node(i, j), lattice.node(i, j + 1)];
            let [c, d] = [lattice.node(i + 1, j + 1), lattice.node(i + 1, j)];
            [[a, b, c], [a, c, d]]
        })
    })
}

/// Sum of the triangles' normals, each as long as its area.
fn normal(sheet: &Sheet) -> DVec3 {
    let of = |n: usize| sheet.points[n];
    triangles(sheet).map(|[a, b, c]| (of(b) - of(a)).cross(of(c) - of(a)) / 2.0).sum()
}

/// Gradient of the sum over all triangles of their normal (as long as their area) times a direction that `towards`
/// finds from the normal and that does not change to first order.
fn faces(sheet: &Sheet, towards: impl Fn(DVec3) -> DVec3) -> Field {
    let mut field = Vec::new();
    for [a, b, c] in triangles(sheet) {
        let (ab, ac) = (sheet.points[b] - sheet.points[a], sheet.points[c] - sheet.points[a]);
        let direction = towards(ab.cross(ac)) / 2.0;
        let (of_b, of_c) = (ac.cross(direction), direction.cross(ab));
        field.extend([(a, -of_b - of_c), (b, of_b), (c, of_c)]);
    }
    field
}

/// Gradient of the length of a line through nodes.
fn along(sheet: &Sheet, line: &[usize]) -> Field {
    let pieces = line.windows(2).flat_map(|pair| {
        let way = (sheet.points[pair[1]] - sheet.points[pair[0]]).normalize_or_zero();
        [(pair[0], -way), (pair[1], way)]
    });
    pieces.collect()
}

fn length(sheet: &Sheet, line: &[usize]) -> f64 {
    path_length(line.iter().map(|n| sheet.points[*n]))
}

/// Gradient of the sum of a line's turns over its length.
fn curvature(sheet: &Sheet, line: &[usize]) -> Field {
    let total = length(sheet, line).max(f64::MIN_POSITIVE);
    let (mut field, mut turns) = (Vec::new(), 0.0);
    for corner in line.windows(3) {
        let [a, b, c] = [0, 1, 2].map(|k| sheet.points[corner[k]]);
        let (first, second) = (b - a, c - b);
        let angle = first.angle_between(second);
        // A straight corner turns either way alike, to first order not at all.
        let (Some(one), Some(other)) = (first.try_normalize(), second.try_normalize()) else { continue };
        turns += angle;
        if angle < 1e-6 {
            continue;
        }
        let by_first = -(other - one * angle.cos()) / (angle.sin() * first.length());
        let by_second = -(one - other * angle.cos()) / (angle.sin() * second.length());
        field.extend([(corner[0], -by_first), (corner[1], by_first - by_second), (corner[2], by_second)]);
    }
    field.extend(along(sheet, line).into_iter().map(|(n, way)| (n, way * (-turns / total))));
    field.into_iter().map(|(n, way)| (n, way / total)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::leaf::Lattice;

    fn bumpy(lattice: Lattice) -> Vec<DVec3> {
        let point = |n: usize| {
            let (i, j) = (n / lattice.columns(), n % lattice.columns());
            let (v, u) = (i as f64 / (lattice.rows() - 1) as f64, j as f64 / (lattice.columns() - 1) as f64 - 0.5);
            let wide = 0.08 * (v * (1.0 - v)).sqrt() + 1e-4;
            DVec3::new(u * wide, 0.1 * v, 0.02 * (3.0 * v).sin() + 0.2 * u * u * v)
        };
        (0..lattice.len()).map(point).collect()
    }

    /// The traits as numbers, in the order of the keys below.
    fn values(sheet: &Sheet) -> [f64; 5] {
        let (rows, columns) = (sheet.lattice.rows(), sheet.lattice.columns());
        let vein: Vec<usize> = (0..rows).map(|i| sheet.lattice.node(i, columns / 2)).collect();
        let of = |n: usize| sheet.points[n];
        let area = triangles(sheet).map(|[a, b, c]| (of(b) - of(a)).cross(of(c) - of(a)).length() / 2.0).sum();
        let turns: f64 = vein.windows(3).map(|p| (of(p[1]) - of(p[0])).angle_between(of(p[2]) - of(p[1]))).sum();
        let chord = of(vein[rows - 1]) - of(vein[0]);
        let along = length(sheet, &vein);
        [area, along, turns / along, normal(sheet).angle_between(DVec3::Z), chord.y.atan2(chord.x)]
    }

    #[test]
    fn fields_are_the_gradients_of_finite_differences() {
        let lattice = Lattice::every(4, 7);
        let sheet = Sheet::new(bumpy(lattice), lattice);
        let fields = of(&sheet, DVec3::Z);
        let order =
            [keys::LEAF_AREA, keys::LEAF_LENGTH, keys::LEAF_CURVATURE, keys::LEAF_INCLINATION, keys::LEAF_AZIMUTH];
        // A smooth push of every node, so that the base row, which is one point, stays one.
        let push = |p: &DVec3| DVec3::new(p.y * 3.0 - p.z, 0.4 * p.x + p.y, 0.7 * p.y * 10.0 * p.x + 0.3 * p.x);
        let moved = |by: f64| Sheet::new(sheet.points.iter().map(|p| *p + push(p) * by).collect(), lattice);
        let (after, before) = (values(&moved(1e-6)), values(&moved(-1e-6)));
        for (k, key) in order.into_iter().enumerate() {
            let (_, field) = fields.iter().find(|(of, _)| *of == key).expect("listed");
            let found: f64 = field[0].iter().map(|(n, way)| way.dot(push(&sheet.points[*n]))).sum();
            let finite = (after[k] - before[k]) / 2e-6;
            assert!((found - finite).abs() < 1e-6 * (1.0 + finite.abs()), "{key}: {found} and {finite}");
            assert!(finite.abs() > 1e-5, "{key} does not change, so this shows nothing");
        }
    }
}
