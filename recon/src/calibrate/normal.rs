//! The normal equations of a calibration: nine numbers of the lens are shared, six of its pose belong to each view, so the
//! poses are eliminated view by view (Schur's complement) and what is solved stays nine by nine.

use demeter_frame::{Distortion, Pose};
use glam::{DMat2, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

use super::BoardView;

/// Numbers of the lens: fx, fy, cx, cy, k1, k2, p1, p2, k3.
pub(super) const LENS: usize = 9;

type Lens = SVector<f64, LENS>;
type Turn = SVector<f64, 6>;

/// Lens and poses as they are thought to be.
#[derive(Clone, Debug)]
pub(super) struct Guess {
    pub lens: Lens,
    /// The camera's frame from the board's, of each view.
    pub poses: Vec<Pose>,
}

/// A point of the board in the picture, and how that depends on lens and pose.
struct Seen {
    at: DVec2,
    by_lens: [DVec2; LENS],
    by_pose: [DVec2; 6],
}

impl Guess {
    fn distortion(&self) -> Distortion {
        let lens = &self.lens;
        Distortion::PlumbBob { coefficients: [lens[4], lens[5], lens[6], lens[7], lens[8]] }
    }

    fn focal(&self) -> DVec2 {
        DVec2::new(self.lens[0], self.lens[1])
    }

    /// Where a point of the board is seen; not a number behind the camera.
    fn project(&self, lens: &Distortion, pose: &Pose, board: DVec2) -> DVec2 {
        let x = pose.point(board.extend(0.0));
        if x.z <= 0.0 {
            return DVec2::NAN;
        }
        self.focal() * lens.bend(x.truncate() / x.z).0 + DVec2::new(self.lens[2], self.lens[3])
    }

    fn seen(&self, lens: &Distortion, pose: &Pose, board: DVec2) -> Seen {
        let arm = pose.rotation * board.extend(0.0);
        let x = arm + pose.translation;
        let p = x.truncate() / x.z;
        let (bent, slope) = lens.bend(p);
        let f = self.focal();
        let [k1, k2, p1, p2, k3] = lens.shares(p).map(|share| f * share);
        let by_point = DMat2::from_diagonal(f) * slope;
        let by = |d: DVec3| by_point * ((d.truncate() - p * d.z) / x.z);
        let turned = |axis: DVec3| by(axis.cross(arm));
        Seen {
            at: f * bent + DVec2::new(self.lens[2], self.lens[3]),
            by_lens: [DVec2::new(bent.x, 0.0), DVec2::new(0.0, bent.y), DVec2::X, DVec2::Y, k1, k2, p1, p2, k3],
            by_pose: [turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z), by(DVec3::X), by(DVec3::Y), by(DVec3::Z)],
        }
    }

    /// The sum of squares of a view, pixels squared; not a number where the board is behind the camera.
    pub(super) fn view_cost(&self, view: &BoardView, pose: &Pose) -> f64 {
        let lens = self.distortion();
        view.points.iter().map(|(board, at)| (self.project(&lens, pose, *board) - *at).length_squared()).sum()
    }

    /// The sum of squares of all views.
    pub(super) fn cost(&self, views: &[BoardView]) -> f64 {
        views.iter().zip(&self.poses).map(|(view, pose)| self.view_cost(view, pose)).sum()
    }

    /// The guess after a step: rotations are turned in the camera's frame.
    pub(super) fn moved(&self, lens: &Lens, poses: &[Turn]) -> Self {
        let pose = |(pose, d): (&Pose, &Turn)| {
            let turn = DQuat::from_scaled_axis(DVec3::new(d[0], d[1], d[2]));
            Pose::new(turn * pose.rotation, pose.translation + DVec3::new(d[3], d[4], d[5]))
        };
        Self { lens: self.lens + lens, poses: self.poses.iter().zip(poses).map(pose).collect() }
    }

    /// The normal equations here.
    pub(super) fn system(&self, views: &[BoardView]) -> System {
        let lens = self.distortion();
        let mut system = System { lens: SMatrix::zeros(), pull: SVector::zeros(), views: Vec::new() };
        for (view, pose) in views.iter().zip(&self.poses) {
            let mut block = Block { cross: SMatrix::zeros(), pose: SMatrix::zeros(), pull: SVector::zeros() };
            for (board, at) in &view.points {
                let seen = self.seen(&lens, pose, *board);
                let miss = *at - seen.at;
                for row in [|v: DVec2| v.x, |v: DVec2| v.y] {
                    let by_lens = Lens::from(seen.by_lens.map(row));
                    let by_pose = Turn::from(seen.by_pose.map(row));
                    system.lens += by_lens * by_lens.transpose();
                    system.pull += by_lens * row(miss);
                    block.cross += by_lens * by_pose.transpose();
                    block.pose += by_pose * by_pose.transpose();
                    block.pull += by_pose * row(miss);
                }
            }
            system.views.push(block);
        }
        system
    }
}

/// Normal equations: a block of the lens, and one of each view's pose.
pub(super) struct System {
    lens: SMatrix<f64, LENS, LENS>,
    pub pull: Lens,
    pub views: Vec<Block>,
}

pub(super) struct Block {
    cross: SMatrix<f64, LENS, 6>,
    pose: SMatrix<f64, 6, 6>,
    pub pull: Turn,
}

impl System {
    /// The step of lens and poses under Marquardt's damping; `None` where the equations have no answer.
    pub(super) fn step(&self, damping: f64) -> Option<(Lens, Vec<Turn>)> {
        let (mut lens, mut pull) = (self.lens, self.pull);
        lens.set_diagonal(&(self.lens.diagonal() * (1.0 + damping)));
        let mut inverses = Vec::new();
        for block in &self.views {
            let mut pose = block.pose;
            pose.set_diagonal(&(block.pose.diagonal() * (1.0 + damping)));
            let inverse = pose.cholesky()?.inverse();
            lens -= block.cross * inverse * block.cross.transpose();
            pull -= block.cross * inverse * block.pull;
            inverses.push(inverse);
        }
        let step = lens.cholesky()?.solve(&pull);
        let pose =
            |(block, inverse): (&Block, &SMatrix<f64, 6, 6>)| inverse * (block.pull - block.cross.transpose() * step);
        Some((step, self.views.iter().zip(&inverses).map(pose).collect()))
    }

    /// The variance of each number of the lens for points seen with a variance of 1; `None` where they are not decided.
    pub(super) fn lens_variance(&self) -> Option<Lens> {
        let mut lens = self.lens;
        for block in &self.views {
            lens -= block.cross * block.pose.cholesky()?.inverse() * block.cross.transpose();
        }
        Some(lens.cholesky()?.inverse().diagonal())
    }
}
