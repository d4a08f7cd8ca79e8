//! Organs seen in a mirror: a left half that curls is as likely as a right one.

use glam::DQuat;
use nalgebra::DVector;

use crate::model::leaf::{ANGLES, ROWS, Side, VEIN, side_angle, vein_angle};
use crate::model::stem;

/// The joint angles `[3700]` of a blade's image in the plane x = 0: turns about x stay, those about y and z change
/// sign, sides change places.
pub(super) fn mirrored_leaf(angles: &DVector<f64>) -> DVector<f64> {
    let mut image = DVector::zeros(ANGLES);
    for row in 1..ROWS {
        image[vein_angle(row)] = angles[vein_angle(row)];
        image[vein_angle(row) + 1] = -angles[vein_angle(row) + 1];
    }
    for (row, k) in (1..ROWS - 1).flat_map(|row| (1..=VEIN).map(move |k| (row, k))) {
        for (to, from) in [(Side::Left, Side::Right), (Side::Right, Side::Left)] {
            let (to, from) = (side_angle(row, to, k), side_angle(row, from, k));
            image[to] = -angles[from];
            image[to + 1] = -angles[from + 1];
        }
    }
    image
}

/// The joint angles `[46]` of a stem's image in the plane x = 0.
pub(super) fn mirrored_stem(angles: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(stem::ANGLES, |q, _| if q % 2 == 0 { angles[q] } else { -angles[q] })
}

/// The joint angles of a stem rolled about its first bone, so that its gauge rolls it no more.
///
/// A chain without twist keeps its shape when every bend (a, 0, b) turns alike about +y.
pub(super) fn without_roll(angles: &DVector<f64>, gauge: DQuat) -> DVector<f64> {
    // The gauge is a swing that puts the chord upright after a roll about +y; only the roll is taken here.
    let roll = 2.0 * gauge.y.atan2(gauge.w);
    let (sin, cos) = roll.sin_cos();
    DVector::from_fn(stem::ANGLES, |q, _| {
        let (a, b) = (angles[q - q % 2], angles[q - q % 2 + 1]);
        if q % 2 == 0 { a * cos + b * sin } else { b * cos - a * sin }
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::model::leaf::{Blade, COLUMNS, node};
    use crate::model::{Basis, Species};
    use crate::species::generic;

    /// The species with one bend only: the given angles at γ = 1.
    fn bent(leaf: &DVector<f64>, stem: &DVector<f64>) -> Species {
        let mut species = generic("soybean").unwrap().unwrap();
        let basis = |angles: &DVector<f64>| {
            Basis::from_modes(DVector::zeros(angles.len()), &nalgebra::DMatrix::from_rows(&[angles.transpose()]))
                .unwrap()
        };
        species.leaf.deform = basis(leaf);
        species.stem.deform = basis(stem);
        species
    }

    fn angles(count: usize) -> impl Strategy<Value = DVector<f64>> {
        proptest::collection::vec(-0.2..0.2f64, count).prop_map(DVector::from_vec)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        #[test]
        fn the_image_of_the_angles_is_the_image_of_the_points(leaf in angles(ANGLES), stem in angles(stem::ANGLES)) {
            let image = DVec3::new(-1.0, 1.0, 1.0);
            let species = bent(&leaf, &stem);
            let mirrored = bent(&mirrored_leaf(&leaf), &mirrored_stem(&stem));
            let blade = Blade { beta: Vec::new(), gamma: vec![1.0], width: 1.0 };
            let (one, other) = (species.leaf.grid(&blade).points, mirrored.leaf.grid(&blade).points);
            for (i, j) in (0..ROWS).flat_map(|i| (0..COLUMNS).map(move |j| (i, j))) {
                prop_assert!((one[node(i, j)] * image).distance(other[node(i, COLUMNS - 1 - j)]) < 1e-9);
            }
            let (one, other) = (species.stem.jacobian(&[1.0]).points, mirrored.stem.jacobian(&[1.0]).points);
            for (p, q) in one.iter().zip(&other) {
                prop_assert!((*p * image).distance(*q) < 1e-9);
            }
        }

        #[test]
        fn a_rolled_stem_comes_back_from_any_roll(stem in angles(stem::ANGLES), roll in -3.0..3.0f64) {
            let leaf = DVector::from_element(ANGLES, 0.01);
            let gauged = |angles: &DVector<f64>| {
                let gauge = stem::gauge(&bent(&leaf, angles).stem.jacobian(&[1.0]).points);
                without_roll(angles, gauge)
            };
            let rolled = without_roll(&stem, DQuat::from_rotation_y(roll));
            prop_assert!((gauged(&rolled) - gauged(&stem)).amax() < 1e-9);
            prop_assert!((gauged(&gauged(&stem)) - gauged(&stem)).amax() < 1e-9);
        }
    }
}
