//! Laws of lenses: there and back again, derivatives, what a straightened picture shows.
#![allow(clippy::unwrap_used)]

use demeter_frame::{Calibration, CameraError, Distortion, Intrinsics, OutOfView, Rgb, Undistort};
use glam::{DVec2, DVec3};
use proptest::prelude::*;

fn plumb_bob(coefficients: [f64; 5]) -> Distortion {
    Distortion::PlumbBob { coefficients }
}

fn fisheye(coefficients: [f64; 4]) -> Distortion {
    Distortion::Equidistant { coefficients }
}

fn camera(lens: Distortion) -> Calibration {
    let k = Intrinsics { width: 752, height: 480, fx: 458.7, fy: 457.3, cx: 367.2, cy: 248.4 };
    Calibration::new(k, Some(lens)).unwrap()
}

/// Barrels, pincushions and fisheyes as real ones are.
fn lenses() -> impl Strategy<Value = Distortion> {
    let bob = (-0.3..0.3, 0.0..0.1, -0.003..0.003, -0.003..0.003, 0.0..0.02);
    let bob = bob.prop_map(|(k1, k2, p1, p2, k3): (f64, f64, f64, f64, f64)| plumb_bob([k1, k2 + k1 * k1, p1, p2, k3]));
    let fish = (-0.05..0.05, -0.02..0.02, -0.01..0.01, -0.002..0.002);
    bob.boxed().prop_union(fish.prop_map(|(a, b, c, d): (f64, f64, f64, f64)| fisheye([a, b, c, d])).boxed())
}

proptest! {
    #[test]
    fn every_pixel_comes_back(lens in lenses(), x in 0.0..752.0, y in 0.0..480.0, z in 0.1..10.0) {
        let (camera, at) = (camera(lens), DVec2::new(x, y));
        let point = camera.unproject(at, z).unwrap();
        prop_assert!((point.z - z).abs() < 1e-12);
        prop_assert!((camera.project(point).unwrap() - at).length() < 1e-8);
    }

    #[test]
    fn derivatives_agree_with_differences(lens in lenses(), x in -1.2..1.2, y in -1.2..1.2) {
        const H: f64 = 1e-6;
        let p = DVec2::new(x, y);
        let (at, slope) = lens.bend(p);
        let by = |step: DVec2| (lens.bend(p + step).0 - lens.bend(p - step).0) / (2.0 * H);
        prop_assert!((slope.x_axis - by(DVec2::X * H)).length() < 1e-7);
        prop_assert!((slope.y_axis - by(DVec2::Y * H)).length() < 1e-7);
        // Both models are linear in their coefficients, so their shares add up to what the lens does.
        let zero = match lens { Distortion::PlumbBob { .. } => p, Distortion::Equidistant { .. } => p.normalize_or_zero() * p.length().atan() };
        let sum = lens.shares(p).iter().zip(lens.coefficients()).map(|(share, k)| *share * *k).sum::<DVec2>();
        prop_assert!((zero + sum - at).length() < 1e-12);
    }

    #[test]
    fn the_pinhole_sees_nothing_that_the_lens_did_not(lens in lenses(), x in 0.0..752.0, y in 0.0..480.0) {
        let camera = camera(lens);
        let pinhole = camera.pinhole();
        prop_assert_eq!((pinhole.width, pinhole.height, pinhole.fx), (752, 480, pinhole.fy));
        let from = camera.project(pinhole.unproject(DVec2::new(x, y), 1.0)).unwrap();
        // Half a pixel for edges that bend between two of the pixels that were looked at.
        prop_assert!(from.x > -0.5 && from.y > -0.5 && from.x < 752.5 && from.y < 480.5, "{from}");
    }

    #[test]
    fn whatever_the_coefficients_nothing_panics_or_is_nan(k in prop::array::uniform5(-1e3..1e3), x in -1e4..1e4, y in -1e4..1e4) {
        let [a, b, c, d, _] = k;
        for lens in [plumb_bob(k), fisheye([a, b, c, d])] {
            let k = Intrinsics::from_hfov(64, 48, 1.0);
            let Ok(camera) = Calibration::new(k, Some(lens)) else { continue };
            prop_assert!(camera.pinhole().validated().is_ok());
            if let Ok(point) = camera.unproject(DVec2::new(x, y), 1.0) {
                prop_assert!(point.is_finite());
                prop_assert!((camera.project(point).unwrap() - DVec2::new(x, y)).length() < 1e-3);
            }
        }
    }
}

#[test]
fn opencv_s_own_numbers() {
    // cv2.projectPoints and cv2.fisheye.projectPoints by their formulas, worked out by hand for one point.
    let p = DVec2::new(0.5, -0.25);
    let (r2, k) = (0.3125_f64, [-0.2, 0.1, 0.01, -0.02, 0.05]);
    let radial = 1.0 + k[0] * r2 + k[1] * r2.powi(2) + k[4] * r2.powi(3);
    let x = 0.5 * radial + 2.0 * k[2] * 0.5 * -0.25 + k[3] * (r2 + 2.0 * 0.25);
    let y = -0.25 * radial + k[2] * (r2 + 2.0 * 0.0625) + 2.0 * k[3] * 0.5 * -0.25;
    assert!((plumb_bob(k).bend(p).0 - DVec2::new(x, y)).length() < 1e-15);
    let angle = r2.sqrt().atan();
    let bent = angle + 0.1 * angle.powi(3) - 0.05 * angle.powi(5) + 0.02 * angle.powi(7) - 0.01 * angle.powi(9);
    assert!((fisheye([0.1, -0.05, 0.02, -0.01]).bend(p).0 - p * (bent / r2.sqrt())).length() < 1e-15);
}

#[test]
fn what_is_out_of_view_says_so() {
    // 1 - 0.9 r² folds at r = 1.054.
    let camera = camera(plumb_bob([-0.3, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(camera.project(DVec3::new(0.0, 0.0, -1.0)), Err(OutOfView::Behind { found: -1.0 }));
    let Err(OutOfView::Beyond { expected, found }) = camera.project(DVec3::new(1.2, 0.0, 1.0)) else { panic!() };
    assert!((expected - 46.5).abs() < 0.5 && (found - 50.2).abs() < 0.1, "{expected} {found}");
    let far = DVec2::new(367.2 + 458.7, 248.4);
    assert_eq!(camera.unproject(far, 1.0), Err(OutOfView::Unreached { found: far }));
    let nan = camera.project(DVec3::new(f64::NAN, 0.0, 1.0)).unwrap_err();
    assert!(matches!(nan, OutOfView::Beyond { .. }), "{nan}");
}

#[test]
fn no_lens_is_refused_by_name() {
    let k = Intrinsics::from_hfov(640, 480, 1.0);
    for lens in [plumb_bob([f64::NAN, 0.0, 0.0, 0.0, 0.0]), plumb_bob([-50.0, 0.0, 0.0, 0.0, 0.0])] {
        let error = Calibration::new(k, Some(lens)).unwrap_err();
        assert!(matches!(error, CameraError::Intrinsics { key: "distortion", .. }), "{error}");
    }
    assert!(Calibration::new(k, None).unwrap().sized(320, 240).unwrap_err().to_string().contains("320x240"));
    assert!(Calibration::new(Intrinsics { fx: -1.0, ..k }, None).is_err());
    assert!(Calibration::new(Intrinsics { width: 1, ..k }, Some(fisheye([0.0; 4]))).is_err());
}

#[test]
fn a_pinhole_is_left_alone_and_a_lens_of_noughts_bends_nothing() {
    let k = Intrinsics { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 24.5 };
    let pinhole = Calibration::new(k, None).unwrap();
    assert!(Undistort::of(&pinhole).is_none());
    assert_eq!(pinhole.pinhole(), k);
    let table = Undistort::of(&Calibration::new(k, Some(plumb_bob([0.0; 5]))).unwrap()).unwrap();
    assert!((table.pinhole().fx - 60.0).abs() < 1e-9 && (table.pinhole().cx - 31.5).abs() < 1e-9);
    let picture = Rgb::from_fn(64, 48, |x, y| image::Rgb([x as u8 * 3, y as u8 * 5, 7]));
    assert_eq!(table.picture(&picture).as_ref(), Ok(&picture));
    assert!(table.picture(&Rgb::new(48, 64)).is_err());
}

/// Lines that a lens has bent are straight again, at places that the pinhole tells.
#[test]
fn straightened_pictures_show_what_the_pinhole_says() {
    for lens in [
        plumb_bob([-0.28, 0.07, 1e-3, -5e-4, 0.0]),
        plumb_bob([0.2, 0.05, 0.0, 2e-3, 0.01]),
        fisheye([-0.01, 0.005, 0.0, 0.0]),
    ] {
        let camera = camera(lens);
        // A slanted edge in the world, x + 0.4 y = 0.1 on the plane one metre away, blurred over about a pixel.
        let side = |p: DVec3| ((p.x + 0.4 * p.y - 0.1) * 400.0).clamp(-1.0, 1.0);
        let grey = |v: f64| image::Rgb([(127.5 + 100.0 * v).round() as u8; 3]);
        let centre = |x: u32, y: u32| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let bent = Rgb::from_fn(752, 480, |x, y| grey(side(camera.unproject(centre(x, y), 1.0).unwrap())));
        let table = Undistort::of(&camera).unwrap();
        let straight = table.picture(&bent).unwrap();
        let pinhole = table.pinhole();
        let worst = straight.enumerate_pixels().map(|(x, y, pixel)| {
            let truth = grey(side(pinhole.unproject(centre(x, y), 1.0)));
            pixel.0[0].abs_diff(truth.0[0])
        });
        // The edge rises by some 100 a pixel: 30 are a third of one, half of which bilinear interpolation costs at corners
        // of the ramp.
        assert!(worst.max() <= Some(30), "{lens:?}");
    }
}

#[test]
fn it_is_written_as_it_is_read() {
    for lens in [plumb_bob([0.1, 0.2, 0.3, 0.4, 0.5]), fisheye([1.0, 2.0, 3.0, 4.0])] {
        assert_eq!(toml::from_str::<Distortion>(&toml::to_string(&lens).unwrap()).unwrap(), lens);
    }
    let few = toml::from_str::<Distortion>("model = 'plumb_bob'\ncoefficients = [1.0]").unwrap_err();
    assert!(few.to_string().contains("array of length 5"), "{few}");
    let other = toml::from_str::<Distortion>("model = 'fov'\ncoefficients = [1.0]").unwrap_err();
    assert!(other.to_string().contains("`plumb_bob`"), "{other}");
}
