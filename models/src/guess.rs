use demeter_frame::{Intrinsics, Tilt};
use glam::DVec3;
use ndarray::ArrayView1;

/// What a picture tells of the camera that took it: the role of PerspectiveFields (Jin et al. 2023).
///
/// The picture is taken to be whole, with its principal point in its middle and square pixels. One that was cut out of a
/// larger picture is described as a camera that looks along the cutting's own middle, so the field of view and the tilt
/// are of what is seen, and go with the picture as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraGuess {
    /// Horizontal field of view, from the left edge's middle to the right edge's, radians, above 0 and below π.
    pub hfov: f64,
    /// How the camera is held.
    pub tilt: Tilt,
    /// Standard deviation that the network expects of the field of view, as a part of its own: of ln tan(hfov / 2).
    pub hfov_spread: f64,
    /// Standard deviation that the network expects of the upward direction, radians.
    pub tilt_spread: f64,
}

impl CameraGuess {
    /// Numbers that the network gives: ln tan(hfov / 2); up in the camera's frame (right, down, forward); logarithms of
    /// the standard deviations of the first and of up (radians).
    pub(crate) const NUMBERS: usize = 6;

    /// From the network's numbers. `stretch` is how much taller the picture was made than it was wide: sides are rounded,
    /// and up is seen through that.
    pub(crate) fn of(numbers: ArrayView1<'_, f32>, stretch: f64) -> Self {
        let number = |i: usize| f64::from(numbers[i]);
        let up = DVec3::new(number(1), number(2) / stretch, number(3));
        Self {
            // Between the narrowest and the widest pinhole that single precision tells from 0 and π.
            hfov: 2.0 * number(0).clamp(-15.0, 15.0).exp().atan(),
            tilt: Tilt::of_up(up.try_normalize().unwrap_or(DVec3::NEG_Y)),
            hfov_spread: number(4).exp(),
            tilt_spread: number(5).exp(),
        }
    }

    /// The camera for a picture of this size.
    #[must_use]
    pub fn intrinsics(&self, width: u32, height: u32) -> Intrinsics {
        Intrinsics::from_hfov(width, height, self.hfov)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::arr1;

    use super::*;

    #[test]
    fn numbers_become_angles_and_a_stretched_picture_is_unstretched() {
        let guess = CameraGuess::of(arr1(&[0.0, 0.0, -0.8, -0.6, -2.0, -3.0]).view(), 1.0);
        assert!((guess.hfov - std::f64::consts::FRAC_PI_2).abs() < 1e-7);
        assert!((guess.tilt.pitch + 0.6f64.asin()).abs() < 1e-6 && guess.tilt.roll.abs() < 1e-12);
        assert!((guess.hfov_spread - (-2f64).exp()).abs() < 1e-9 && (guess.tilt_spread - (-3f64).exp()).abs() < 1e-9);
        let camera = guess.intrinsics(640, 480);
        assert!((camera.fx - 320.0).abs() < 1e-3 && camera.cy == 240.0);
        // A picture made twice as tall shows the vanishing point of up twice as far below its middle.
        let tall = CameraGuess::of(arr1(&[0.0, 0.0, -1.6, -0.6, 0.0, 0.0]).view(), 2.0);
        assert!((tall.tilt.pitch - guess.tilt.pitch).abs() < 1e-6);
    }

    #[test]
    fn any_finite_numbers_make_a_camera() {
        for number in [0.0, 1e30, -1e30, f32::MAX, f32::MIN_POSITIVE] {
            let guess = CameraGuess::of(arr1(&[number; CameraGuess::NUMBERS]).view(), 1.0);
            assert!(guess.hfov > 0.0 && guess.hfov < std::f64::consts::PI, "{guess:?}");
            assert!(guess.tilt.pitch.is_finite() && guess.tilt.roll.is_finite(), "{guess:?}");
        }
    }
}
