use glam::{DVec2, DVec3};

use crate::{CameraError, Distortion, Intrinsics};

/// The tangent of the farthest angle from the axis at which a lens is followed: 80 degrees. Beyond it a pinhole has no
/// use for what a fisheye sees.
const FARTHEST: f64 = 5.67;
/// The tangent of the farthest angle that goes into an undistorted picture, 60 degrees: a guess at where a pinhole stretches
/// what it shows too much.
const WIDEST: f64 = 1.732;
/// The least part of the shorter side that a lens must describe before its picture folds, as a radius: a guess below which a
/// calibration is nonsense.
const LEAST_REACH: f64 = 0.25;

/// Why a point or a pixel has no counterpart in a camera.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OutOfView {
    /// The point is not before the camera.
    #[error("expected a point before the camera, found z = {found} m")]
    Behind {
        /// Its depth, metres.
        found: f64,
    },
    /// The model of the lens does not hold so far from the axis.
    #[error("expected at most {expected} degrees from the axis, found {found}")]
    Beyond {
        /// How far it holds, degrees.
        expected: f64,
        /// How far the point is, degrees.
        found: f64,
    },
    /// No direction is bent to the pixel.
    #[error("expected a pixel that the lens reaches, found {found}")]
    Unreached {
        /// The pixel.
        found: DVec2,
    },
}

/// A camera with its lens (spec/appliance.md "Cameras"): intrinsics, and how the lens bends the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    intrinsics: Intrinsics,
    distortion: Option<Distortion>,
    /// How far from the axis the lens's model holds, on the plane one metre before the camera.
    reach: f64,
}

impl Calibration {
    /// A calibrated camera.
    ///
    /// # Errors
    /// [`CameraError`] for numbers that no camera has, and a lens whose picture folds back upon itself near its middle.
    pub fn new(intrinsics: Intrinsics, distortion: Option<Distortion>) -> Result<Self, CameraError> {
        let intrinsics = intrinsics.validated()?;
        let Some(lens) = distortion else { return Ok(Self { intrinsics, distortion, reach: FARTHEST }) };
        let bad = |key, expected, found| Err(CameraError::Intrinsics { key, expected, found });
        if let Some(found) = lens.coefficients().iter().find(|x| !x.is_finite()) {
            return bad("distortion", "finite coefficients", *found);
        }
        let shorter = intrinsics.width.min(intrinsics.height);
        if shorter < 2 {
            return bad("width", "at least 2 pixels a side", f64::from(shorter));
        }
        let reach = lens.reach(FARTHEST);
        let calibration = Self { intrinsics, distortion, reach };
        let radius = lens.bend(DVec2::new(reach, 0.0)).0.length() * intrinsics.fx.min(intrinsics.fy);
        let [x0, y0, x1, y1] = calibration.window();
        if !(radius >= LEAST_REACH * f64::from(shorter) && x1 > x0 && y1 > y0) {
            let expected = "coefficients under which the middle of the picture does not fold back upon itself";
            return bad("distortion", expected, lens.coefficients()[0]);
        }
        Ok(calibration)
    }

    /// The same, for pictures of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`CameraError::Size`] when it is for others.
    pub fn sized(self, width: u32, height: u32) -> Result<Self, CameraError> {
        let k = &self.intrinsics;
        let found = [k.width, k.height];
        if found == [width, height] { Ok(self) } else { Err(CameraError::Size { expected: [width, height], found }) }
    }

    /// The camera without its lens.
    #[must_use]
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// How the lens bends the picture; `None` for a pinhole.
    #[must_use]
    pub fn distortion(&self) -> Option<&Distortion> {
        self.distortion.as_ref()
    }

    /// Pixel coordinates of a point in the camera frame.
    ///
    /// # Errors
    /// [`OutOfView`] behind the camera and where the model does not hold.
    pub fn project(&self, x_in_camera: DVec3) -> Result<DVec2, OutOfView> {
        let k = &self.intrinsics;
        let Some(lens) = &self.distortion else {
            return k.project(x_in_camera).ok_or(OutOfView::Behind { found: x_in_camera.z });
        };
        if x_in_camera.z.is_nan() || x_in_camera.z <= 1e-9 {
            return Err(OutOfView::Behind { found: x_in_camera.z });
        }
        let p = x_in_camera.truncate() / x_in_camera.z;
        if p.is_nan() || p.length() > self.reach {
            let degrees = |radius: f64| radius.atan().to_degrees();
            return Err(OutOfView::Beyond { expected: degrees(self.reach), found: degrees(p.length()) });
        }
        let bent = lens.bend(p).0;
        Ok(DVec2::new(k.fx * bent.x + k.cx, k.fy * bent.y + k.cy))
    }

    /// The point seen at pixel coordinates `at` (continuous) with depth `z` in metres.
    ///
    /// # Errors
    /// [`OutOfView`] where no direction is bent to that pixel.
    pub fn unproject(&self, at: DVec2, z: f64) -> Result<DVec3, OutOfView> {
        let flat = self.intrinsics.unproject(at, 1.0);
        let Some(lens) = &self.distortion else { return Ok(flat * z) };
        let p = lens.unbend(flat.truncate(), self.reach).ok_or(OutOfView::Unreached { found: at })?;
        Ok(p.extend(1.0) * z)
    }

    /// The pinhole of an undistorted picture: as many pixels, square, as near the lens's own centre as may be, and nothing
    /// in it that the lens did not see, nor more than 60 degrees from the axis. A pinhole is its own.
    #[must_use]
    pub fn pinhole(&self) -> Intrinsics {
        let k = self.intrinsics;
        if self.distortion.is_none() {
            return k;
        }
        let [x0, y0, x1, y1] = self.window();
        let (width, height) = (f64::from(k.width), f64::from(k.height));
        let f = (width / (x1 - x0)).max(height / (y1 - y0));
        // The centre moves as little as keeps the picture within the window, give or take rounding.
        let centre = |c: f64, side: f64, low: f64, high: f64| c.min(-low * f).max(side - high * f);
        Intrinsics { fx: f, fy: f, cx: centre(k.cx, width, x0, x1), cy: centre(k.cy, height, y0, y1), ..k }
    }

    /// What of the plane one metre before the camera is seen by all rows and all columns: x0, y0, x1, y1.
    fn window(&self) -> [f64; 4] {
        let k = &self.intrinsics;
        let (width, height) = (f64::from(k.width), f64::from(k.height));
        let edge = |x: f64, y: f64| {
            let seen = self.unproject(DVec2::new(x, y), 1.0).map(DVec3::truncate);
            let farthest = self.reach.min(WIDEST);
            let outwards = || (DVec2::new(x - k.cx, y - k.cy) * 1e6).clamp_length_max(farthest);
            seen.unwrap_or_else(|_unreached| outwards()).clamp_length_max(farthest)
        };
        let rows = (0..=k.height).map(f64::from).map(|y| (edge(0.0, y).x, edge(width, y).x));
        let columns = (0..=k.width).map(f64::from).map(|x| (edge(x, 0.0).y, edge(x, height).y));
        let within = |(low, high): (f64, f64), (a, b): (f64, f64)| (low.max(a), high.min(b));
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let ((x0, x1), (y0, y1)) = (rows.fold(all, within), columns.fold(all, within));
        [x0, y0, x1, y1]
    }
}
