//! A camera's calibration (spec/appliance.md "Cameras") from pictures of a flat board whose points are known.
//!
//! Zhang's way (A flexible new technique for camera calibration, 2000): each view's homography tells of the focal length
//! and of the board's pose; from there Levenberg-Marquardt moves the lens and all poses until the points lie where they
//! were seen. The covariance of what comes out is that of least squares, its noise measured by what is left over.

mod normal;
mod start;

use demeter_frame::{Calibration, CameraError, Distortion, Intrinsics, Pose};
use glam::{DVec2, DVec3};
use nalgebra::SVector;

use normal::{Guess, LENS};

/// The least number of views: two leave focal length and distortion undecided.
pub const LEAST_VIEWS: usize = 3;
/// The least points of a view: four fix a homography, and more are needed to see that it is right.
const LEAST_POINTS: usize = 6;
/// How far the board must be tilted against the sensor in one view at least, degrees: a guess. Boards that are parallel
/// to the sensor look the same from near through a wide lens as from far through a long one.
const LEAST_TILT: f64 = 10.0;
/// The largest standard deviation of a focal length that is a calibration, as a share of it: a guess.
const LOOSEST: f64 = 0.01;
/// Most steps; fewer than twenty are usual.
const STEPS: usize = 100;

/// One picture's points: on the board, metres, and where they were seen, pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardView {
    /// Point on the board and pixel.
    pub points: Vec<(DVec2, DVec2)>,
}

/// What a view came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedView {
    /// Where the board was.
    pub camera_from_board: Pose,
    /// How far its points are from where they were seen, root mean square, pixels.
    pub rmse: f64,
    /// The angle between the board and the sensor, degrees.
    pub tilt: f64,
}

/// A camera that was calibrated.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    /// The camera, its lens a plumb bob.
    pub calibration: Calibration,
    /// Standard deviations of fx, fy, cx, cy (pixels), k1, k2, p1, p2 and k3.
    pub deviations: [f64; LENS],
    /// The views, in their order.
    pub views: Vec<FittedView>,
    /// As [`FittedView::rmse`], over all points.
    pub rmse: f64,
}

/// Why views give no calibration.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// Too few views.
    #[error("expected the board in at least {expected} pictures, found it in {found}")]
    TooFew {
        /// [`LEAST_VIEWS`].
        expected: usize,
        /// Views there are.
        found: usize,
    },
    /// A view with too few points, or points in a line.
    #[error("view {view}: expected at least {expected} points that are not in a line, found {found}")]
    View {
        /// Which, from 0.
        view: usize,
        /// The least.
        expected: usize,
        /// Points there are.
        found: usize,
    },
    /// The board was held parallel to the sensor in all views.
    #[error(
        "expected the board tilted against the sensor by at least {expected} degrees in some pictures, found at most \
         {found:.0}: turn it this way and that"
    )]
    Parallel {
        /// The least tilt.
        expected: f64,
        /// The largest there is.
        found: f64,
    },
    /// The views do not decide the focal length.
    #[error(
        "expected a focal length that is sure to {expected} %, found {found:.1} %: more pictures, from nearer, tilted \
         more, up to the corners"
    )]
    Loose {
        /// Largest standard deviation, per cent.
        expected: f64,
        /// Its standard deviation, per cent.
        found: f64,
    },
    /// What came out is no camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

/// The camera that saw the views, its pictures `width` x `height` pixels.
///
/// # Errors
/// [`CalibrateError`] where the views do not tell.
pub fn calibrate(views: &[BoardView], width: u32, height: u32) -> Result<Calibrated, CalibrateError> {
    if views.len() < LEAST_VIEWS {
        return Err(CalibrateError::TooFew { expected: LEAST_VIEWS, found: views.len() });
    }
    let mut guess = start::start(views, width, height)?;
    let mut cost = guess.cost(views);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let next = guess.system(views).step(damping).map(|(lens, poses)| guess.moved(&lens, &poses));
        let better = next.map(|next| (next.cost(views), next)).filter(|(next, _)| *next < cost);
        if let Some((lower, next)) = better {
            let done = cost - lower <= 1e-12 * cost;
            (guess, cost, damping) = (next, lower, (damping * 0.1).max(1e-12));
            if done {
                break;
            }
        } else {
            damping *= 10.0;
            // No step is short enough: this is the bottom.
            if damping > 1e8 {
                break;
            }
        }
    }
    finished(views, guess, cost, width, height)
}

fn finished(
    views: &[BoardView],
    guess: Guess,
    cost: f64,
    width: u32,
    height: u32,
) -> Result<Calibrated, CalibrateError> {
    let points: usize = views.iter().map(|view| view.points.len()).sum();
    let fitted = views.iter().zip(&guess.poses).map(|(view, pose)| FittedView {
        camera_from_board: *pose,
        rmse: (guess.view_cost(view, pose) / view.points.len() as f64).sqrt(),
        tilt: (pose.rotation * DVec3::Z).z.abs().min(1.0).acos().to_degrees(),
    });
    let fitted: Vec<_> = fitted.collect();
    let tilt = fitted.iter().map(|view| view.tilt).fold(0.0, f64::max);
    if tilt < LEAST_TILT {
        return Err(CalibrateError::Parallel { expected: LEAST_TILT, found: tilt });
    }
    // Two numbers a point, less what was fitted to them.
    let free = (2 * points).saturating_sub(LENS + 6 * views.len()).max(1) as f64;
    let none = SVector::repeat(f64::INFINITY);
    let variance = guess.system(views).lens_variance().map_or(none, |unit| unit * (cost / free));
    let deviations: [f64; LENS] = variance.map(f64::sqrt).into();
    let [fx, fy, cx, cy, coefficients @ ..] = <[f64; LENS]>::from(guess.lens);
    let loose = (deviations[0] / fx).max(deviations[1] / fy);
    if loose.is_nan() || loose > LOOSEST {
        return Err(CalibrateError::Loose { expected: 100.0 * LOOSEST, found: 100.0 * loose });
    }
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    let calibration = Calibration::new(intrinsics, Some(Distortion::PlumbBob { coefficients }))?;
    Ok(Calibrated { calibration, deviations, views: fitted, rmse: (cost / points as f64).sqrt() })
}

#[cfg(test)]
mod tests;
