//! How near a basis of so many components comes to organs that it was not learned from.

use glam::{DQuat, DVec3};
use nalgebra::DVector;

use super::deform::{Belief, LearnError, leaf_basis, stem_basis};
use super::lesson::Lesson;
use super::pca::folds;
use super::smooth::smooth;
use crate::fit::solver::{Normal, minimise};
use crate::model::leaf::Blade;
use crate::model::{Basis, Species};
use crate::statistics::mean;

/// Folds of the clouds: organs of one plant are alike and must be left out together.
const FOLDS: usize = 5;
/// Steps of the fit of coefficients to known points; it starts from the projection and needs few.
const STEPS: usize = 6;

/// Errors of one number of components.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Reach {
    /// Components.
    pub components: usize,
    /// Mean distance between corresponding control points of left-out blades, as a share of the blade's length.
    pub leaf: f64,
    /// The same of stems; `None` without stems.
    pub stem: Option<f64>,
}

/// The errors of left-out organs for each number of `components`.
///
/// # Errors
/// [`LearnError`] when a fold teaches nothing.
pub fn reach(lessons: &[Lesson], from: &Species, components: &[usize]) -> Result<Vec<Reach>, LearnError> {
    let smooth = smooth(from)?;
    let teaching: Vec<&Lesson> = lessons.iter().filter(|l| !l.leaves.is_empty()).collect();
    let mut reached = Vec::with_capacity(components.len());
    for k in components {
        let (mut leaf, mut stem) = (Vec::new(), Vec::new());
        for (rest, held) in folds(teaching.len(), FOLDS) {
            let leaves: Vec<&DVector<f64>> = rest.iter().flat_map(|i| &teaching[*i].leaves).collect();
            let stems: Vec<&DVector<f64>> = rest.iter().flat_map(|i| &teaching[*i].stems).collect();
            let basis = leaf_basis(&leaves, &smooth, *k, Belief::Smooth)?;
            leaf.extend(held.iter().flat_map(|i| &teaching[*i].leaves).map(|a| leaf_error(a, &basis, &smooth)));
            if !stems.is_empty() {
                let basis = stem_basis(&stems, &smooth, *k, Belief::Smooth)?;
                stem.extend(held.iter().flat_map(|i| &teaching[*i].stems).map(|a| stem_error(a, &basis, &smooth)));
            }
        }
        reached.push(Reach { components: *k, leaf: mean(&leaf).ok_or(LearnError::NoBlades)?, stem: mean(&stem) });
    }
    Ok(reached)
}

fn leaf_error(angles: &DVector<f64>, basis: &Basis, smooth: &Species) -> f64 {
    let posed = |deform: &Basis, gamma: &[f64]| {
        let mut model = smooth.leaf.clone();
        model.deform = deform.clone();
        let jacobian = model.jacobian(&Blade { beta: Vec::new(), gamma: gamma.to_vec(), width: 1.0 });
        let first = model.shape.rank();
        (jacobian.points.clone(), move |n: usize, k: usize| jacobian.derivative(n, first + k))
    };
    let target = posed(&smooth.leaf.deform, &smooth.leaf.deform.project(angles)).0;
    error(&target, basis.project(angles), |gamma| posed(basis, gamma))
}

fn stem_error(angles: &DVector<f64>, basis: &Basis, smooth: &Species) -> f64 {
    let posed = |deform: &Basis, gamma: &[f64]| {
        let mut model = smooth.stem.clone();
        model.deform = deform.clone();
        let jacobian = model.jacobian(gamma);
        let stride = jacobian.coefficients;
        (jacobian.points, move |n: usize, k: usize| jacobian.derivatives[n * stride + k])
    };
    let target = posed(&smooth.stem.deform, &smooth.stem.deform.project(angles)).0;
    error(&target, basis.project(angles), |gamma| posed(basis, gamma))
}

/// Mean distance to `target` of the organ that comes nearest, any rotation about its base allowed.
fn error<V: Fn(usize, usize) -> DVec3>(
    target: &[DVec3],
    start: Vec<f64>,
    posed: impl Fn(&[f64]) -> (Vec<DVec3>, V),
) -> f64 {
    let mut state = (DQuat::IDENTITY, start);
    minimise(
        &mut state,
        STEPS,
        |(rotation, gamma)| {
            let (points, velocity) = posed(gamma);
            let mut normal = Normal::new(3 + gamma.len());
            let mut row = vec![0.0; 3 + gamma.len()];
            for (n, (p, goal)) in points.iter().zip(target).enumerate() {
                let at = *rotation * *p;
                for axis in DVec3::AXES {
                    row[..3].copy_from_slice(&at.cross(axis).to_array());
                    let local = rotation.inverse() * axis;
                    row[3..].iter_mut().enumerate().for_each(|(k, cell)| *cell = velocity(n, k).dot(local));
                    normal.add((at - *goal).dot(axis), &row, 1.0);
                }
            }
            normal
        },
        |(rotation, gamma), step| {
            let turned = (DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2])) * *rotation).normalize();
            (turned, gamma.iter().enumerate().map(|(k, c)| c + step[3 + k]).collect())
        },
    );
    let points = posed(&state.1).0;
    points.iter().zip(target).map(|(p, goal)| (state.0 * *p).distance(*goal)).sum::<f64>() / target.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::species::generic;
    use crate::world::{Seeded, seeded};
    use rand::Rng;

    /// Lessons of blades that bend in three smooth modes only.
    fn lessons(smooth: &Species, random: &mut Seeded) -> Vec<Lesson> {
        let mut angles = || {
            let mut gamma = vec![0.0; smooth.leaf.deform.rank()];
            [0, 3, 15].into_iter().for_each(|k| gamma[k] = random.random_range(-2.0..2.0));
            smooth.leaf.deform.at(&gamma)
        };
        (0..5).map(|_| Lesson { leaves: (0..4).map(|_| angles()).collect(), ..Lesson::default() }).collect()
    }

    #[test]
    fn as_many_components_as_bends_reach_left_out_blades_and_fewer_do_not() {
        let from = generic("soybean").expect("listed").expect("valid");
        let lessons = lessons(&smooth(&from).expect("independent"), &mut seeded(4));
        let reached = reach(&lessons, &from, &[1, 8]).expect("learned");
        // Eight, because every bend has its mirror image and the smooth modes take their share.
        assert!(reached[0].leaf > 0.01 && reached[1].leaf < 0.3 * reached[0].leaf, "{reached:?}");
        assert_eq!(reached[0].stem, None);
        assert!(matches!(reach(&[], &from, &[1]), Err(LearnError::NoBlades)));
    }
}
