//! The normal equations of a tree of organs, solved block by block from the tips to the root and back: one small
//! factorisation an organ, so that the cost grows with the organs and not with their cube.

use nalgebra::{DMatrix, DVector, Dyn, linalg::Cholesky};

use crate::fit::solver::Equations;

/// Parameters of the place that an organ hangs at: it moves with its parent.
pub(super) const PLACE: usize = 3;
/// Index of d, the first of an organ's own parameters.
pub(super) const D: usize = PLACE;
/// Index of the first of the three of its turn.
pub(super) const TURN: usize = D + 1;

/// One organ's equations over (place, own parameters), and how its place moves with its parent.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// The organ that carries it, before it in the list; `None` for the root, whose place is free.
    pub parent: Option<usize>,
    /// Symmetric, both triangles; places first.
    pub h: DMatrix<f64>,
    pub g: DVector<f64>,
    /// Derivatives of the place by the parent's (place, own parameters): 3 rows; nothing for the root.
    pub carry: DMatrix<f64>,
}

/// The equations of a whole plant.
#[derive(Clone, Debug)]
pub(super) struct TreeEquations {
    pub blocks: Vec<Block>,
    pub cost: f64,
}

/// An organ with its own parameters eliminated: given how its place moves, they are `-(shift + follow * place)`.
struct Eliminated {
    own: Cholesky<f64, Dyn>,
    shift: DVector<f64>,
    follow: DMatrix<f64>,
}

/// A tree with every organ's own parameters eliminated.
struct Upwards {
    organs: Vec<Eliminated>,
    /// What is left on the root's place.
    root: (Cholesky<f64, Dyn>, DVector<f64>),
}

impl TreeEquations {
    /// Eliminates each organ's own parameters, tips first.
    fn eliminate(&self, damping: f64) -> Option<Upwards> {
        let mut h: Vec<DMatrix<f64>> = self.blocks.iter().map(|b| damped(b, damping)).collect();
        let mut g: Vec<DVector<f64>> = self.blocks.iter().map(|b| b.g.clone()).collect();
        let mut eliminated = Vec::with_capacity(h.len());
        let mut root = None;
        for (i, block) in self.blocks.iter().enumerate().rev() {
            let own = g[i].len() - PLACE;
            let factor = h[i].view((PLACE, PLACE), (own, own)).into_owned().cholesky()?;
            let follow = factor.solve(&h[i].view((PLACE, 0), (own, PLACE)));
            let shift = factor.solve(&g[i].rows(PLACE, own));
            let across = h[i].view((0, PLACE), (PLACE, own));
            let left_h = h[i].view((0, 0), (PLACE, PLACE)) - across * &follow;
            let left_g = g[i].rows(0, PLACE) - across * &shift;
            eliminated.push(Eliminated { own: factor, shift, follow });
            match block.parent {
                Some(parent) => {
                    h[parent] += block.carry.tr_mul(&(left_h * &block.carry));
                    g[parent] += block.carry.tr_mul(&left_g);
                }
                None => root = Some((left_h.cholesky()?, left_g)),
            }
        }
        eliminated.reverse();
        Some(Upwards { organs: eliminated, root: root? })
    }

    /// Covariance of each organ's (place, own parameters) when the equations are in units of variance.
    pub(super) fn covariances(&self) -> Option<Vec<DMatrix<f64>>> {
        let Upwards { organs, root: (root, _) } = self.eliminate(0.0)?;
        let mut all: Vec<DMatrix<f64>> = Vec::with_capacity(self.blocks.len());
        for (block, organ) in self.blocks.iter().zip(&organs) {
            let place = match block.parent {
                Some(parent) => &block.carry * &all[parent] * block.carry.transpose(),
                None => root.inverse(),
            };
            // Own parameters follow the place and vary about it besides.
            let with_place = -&organ.follow * &place;
            let own = organ.own.inverse() - &with_place * organ.follow.transpose();
            let n = block.g.len();
            let mut joint = DMatrix::zeros(n, n);
            joint.view_mut((0, 0), (PLACE, PLACE)).copy_from(&place);
            joint.view_mut((PLACE, 0), (n - PLACE, PLACE)).copy_from(&with_place);
            joint.view_mut((0, PLACE), (PLACE, n - PLACE)).copy_from(&with_place.transpose());
            joint.view_mut((PLACE, PLACE), (n - PLACE, n - PLACE)).copy_from(&own);
            all.push(joint);
        }
        Some(all)
    }
}

impl Equations for TreeEquations {
    /// Of each organ's (place, own parameters).
    type Step = Vec<DVector<f64>>;

    fn cost(&self) -> f64 {
        self.cost
    }

    fn step(&self, damping: f64) -> Option<Self::Step> {
        let Upwards { organs, root: (root_h, root_g) } = self.eliminate(damping)?;
        let mut steps: Vec<DVector<f64>> = Vec::with_capacity(self.blocks.len());
        for (block, organ) in self.blocks.iter().zip(&organs) {
            let place = match block.parent {
                Some(parent) => &block.carry * &steps[parent],
                None => -root_h.solve(&root_g),
            };
            let own = -(&organ.shift + &organ.follow * &place);
            steps.push(DVector::from_iterator(block.g.len(), place.iter().chain(own.iter()).copied()));
        }
        steps.iter().all(|step| step.iter().all(|x| x.is_finite())).then_some(steps)
    }
}

/// An organ's own equations damped in its own parameters, the root's also in its place; those that nothing tells get
/// enough to stay where they are. Vectors are damped alike along all axes, so that the world's axes do not matter.
fn damped(block: &Block, damping: f64) -> DMatrix<f64> {
    /// In units of the equations: far below any prior.
    const FLOOR: f64 = 1e-9;
    let mut h = block.h.clone();
    for i in if block.parent.is_some() { PLACE } else { 0 }..h.nrows() {
        let vector = [0, TURN].into_iter().find(|first| (*first..first + 3).contains(&i) && first + 3 <= h.nrows());
        let along = vector.map_or(block.h[(i, i)], |first| block.h.diagonal().rows(first, 3).mean());
        h[(i, i)] += damping * along + FLOOR;
    }
    h
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A random tree of organs with random positive definite blocks.
    fn tree(organs: usize, seed: u64) -> TreeEquations {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut blocks: Vec<Block> = Vec::new();
        for i in 0..organs {
            let parent = (i > 0).then(|| random.random_range(0..i));
            let n = PLACE + random.random_range(1..6);
            let root = DMatrix::from_fn(n, n + 2, |_, _| random.random_range(-1.0..1.0));
            let columns = parent.map_or(0, |p: usize| blocks[p].g.len());
            blocks.push(Block {
                parent,
                h: &root * root.transpose() + DMatrix::identity(n, n) * 0.1,
                g: DVector::from_fn(n, |_, _| random.random_range(-1.0..1.0)),
                carry: DMatrix::from_fn(PLACE, columns, |_, _| random.random_range(-1.0..1.0)),
            });
        }
        TreeEquations { blocks, cost: 0.0 }
    }

    /// The same equations as one matrix over the root's place and every organ's own parameters, and how each organ's
    /// (place, own parameters) follow from those.
    fn dense(tree: &TreeEquations, damping: f64) -> (DMatrix<f64>, DVector<f64>, Vec<DMatrix<f64>>) {
        let total = PLACE + tree.blocks.iter().map(|b| b.g.len() - PLACE).sum::<usize>();
        let (mut h, mut g) = (DMatrix::zeros(total, total), DVector::zeros(total));
        let mut maps: Vec<DMatrix<f64>> = Vec::new();
        let mut first = PLACE;
        for block in &tree.blocks {
            let n = block.g.len();
            let mut map = DMatrix::zeros(n, total);
            match block.parent {
                Some(parent) => map.view_mut((0, 0), (PLACE, total)).copy_from(&(&block.carry * &maps[parent])),
                None => map.view_mut((0, 0), (PLACE, PLACE)).fill_with_identity(),
            }
            map.view_mut((PLACE, first), (n - PLACE, n - PLACE)).fill_with_identity();
            first += n - PLACE;
            h += map.transpose() * damped(block, damping) * &map;
            g += map.transpose() * &block.g;
            maps.push(map);
        }
        (h, g, maps)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

        /// Elimination from the tips to the root is the solution of the same equations as one dense system, and so
        /// are its covariances.
        #[test]
        fn blocks_give_what_the_dense_system_gives(organs in 1..12_usize, seed in any::<u64>(), damping in 0.0..1.0_f64) {
            let tree = tree(organs, seed);
            let (h, g, maps) = dense(&tree, damping);
            let solution = -h.cholesky().expect("positive definite").solve(&g);
            let steps = tree.step(damping).expect("positive definite");
            for (step, map) in steps.iter().zip(&maps) {
                let expected = map * &solution;
                prop_assert!((step - &expected).amax() <= 1e-7 * (1.0 + expected.amax()), "{step} {expected}");
            }
            let (h, _, maps) = dense(&tree, 0.0);
            let inverse = h.cholesky().expect("positive definite").inverse();
            for (found, map) in tree.covariances().expect("positive definite").iter().zip(&maps) {
                let expected = map * &inverse * map.transpose();
                prop_assert!((found - &expected).amax() <= 1e-7 * (1.0 + expected.amax()));
            }
        }
    }
}
