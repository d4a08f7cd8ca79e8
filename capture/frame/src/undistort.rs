use glam::DVec2;

use crate::{Calibration, CameraError, Intrinsics, Rgb};

/// Marks a pixel that the lens did not see.
const UNSEEN: u32 = u32::MAX;
/// Parts of a pixel that places in the lens's picture are rounded to: eight bits, as many as a colour has.
const PARTS: u32 = 256;

/// Takes a lens's bending out of its pictures: a table of where each pixel comes from, built once for a camera.
#[derive(Clone, Debug)]
pub struct Undistort {
    pinhole: Intrinsics,
    taps: Vec<Tap>,
}

/// Where a pixel comes from: the first of four neighbours, and how far beyond it, in [`PARTS`].
#[derive(Clone, Copy, Debug)]
struct Tap {
    first: u32,
    right: u16,
    down: u16,
}

impl Undistort {
    /// The table of a camera; `None` for a pinhole, whose pictures stay as they are.
    #[must_use]
    pub fn of(calibration: &Calibration) -> Option<Self> {
        calibration.distortion()?;
        let pinhole = calibration.pinhole();
        let (width, height) = (pinhole.width, pinhole.height);
        let tap = |x: u32, y: u32| {
            let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let seen = calibration.project(pinhole.unproject(at, 1.0)).ok();
            seen.and_then(|from| Tap::at(from, width, height)).unwrap_or(Tap { first: UNSEEN, right: 0, down: 0 })
        };
        let taps = (0..height).flat_map(|y| (0..width).map(move |x| tap(x, y))).collect();
        Some(Self { pinhole, taps })
    }

    /// The camera that would have taken the undistorted pictures.
    #[must_use]
    pub fn pinhole(&self) -> &Intrinsics {
        &self.pinhole
    }

    /// The undistorted picture, black where the lens saw nothing.
    ///
    /// # Errors
    /// [`CameraError::Size`] for a picture of another size than the camera's.
    pub fn picture(&self, bent: &Rgb) -> Result<Rgb, CameraError> {
        let Intrinsics { width, height, .. } = self.pinhole;
        if bent.dimensions() != (width, height) {
            return Err(CameraError::Size { expected: bent.dimensions().into(), found: [width, height] });
        }
        let (from, row) = (bent.as_raw(), 3 * width as usize);
        let mut straight = Rgb::new(width, height);
        for (to, tap) in straight.chunks_exact_mut(3).zip(&self.taps) {
            if tap.first == UNSEEN {
                continue;
            }
            let first = 3 * tap.first as usize;
            // Two pixels of this row and the two below them.
            let (above, below) = (&from[first..first + 6], &from[first + row..first + row + 6]);
            let (right, down) = (u32::from(tap.right), u32::from(tap.down));
            for (c, value) in to.iter_mut().enumerate() {
                let across = |pair: &[u8]| u32::from(pair[c]) * (PARTS - right) + u32::from(pair[c + 3]) * right;
                let sum = across(above) * (PARTS - down) + across(below) * down;
                *value = ((sum + PARTS * PARTS / 2) / (PARTS * PARTS)) as u8;
            }
        }
        Ok(straight)
    }
}

impl Tap {
    fn at(from: DVec2, width: u32, height: u32) -> Option<Self> {
        let inside = from.x >= 0.0 && from.y >= 0.0 && from.x <= f64::from(width) && from.y <= f64::from(height);
        // The first neighbour has another one to its right and below, so its last parts may be whole.
        let part = |at: f64, side: u32| {
            let parts = ((at - 0.5).clamp(0.0, f64::from(side - 1)) * f64::from(PARTS)).round() as u32;
            let first = (parts / PARTS).min(side - 2);
            (first, (parts - first * PARTS) as u16)
        };
        let ((x, right), (y, down)) = (part(from.x, width), part(from.y, height));
        inside.then_some(Self { first: y * width + x, right, down })
    }
}
