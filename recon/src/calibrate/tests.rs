use proptest::prelude::*;
use rand::Rng;

use super::*;
use crate::world::seeded;

const SIZE: (u32, u32) = (640, 480);

fn truth() -> Calibration {
    let k = Intrinsics { width: SIZE.0, height: SIZE.1, fx: 520.0, fy: 524.0, cx: 331.0, cy: 236.0 };
    Calibration::new(k, Some(Distortion::PlumbBob { coefficients: [-0.25, 0.08, 1e-3, -8e-4, 5e-3] })).unwrap()
}

/// 7 x 5 corners of 30 mm, seen so far away from so far aside, tilted about x and y.
fn view(camera: &Calibration, [x, y, z, tilt_x, tilt_y]: [f64; 5], mut noise: impl FnMut() -> f64) -> BoardView {
    let turn = glam::DQuat::from_rotation_x(tilt_x) * glam::DQuat::from_rotation_y(tilt_y);
    let pose = Pose::new(turn, DVec3::new(x, y, z));
    let corners = (0..35).map(|i| DVec2::new(f64::from(i % 7) - 3.0, f64::from(i / 7) - 2.0) * 0.03);
    let mut seen = |board: DVec2| {
        let at = camera.project(pose.point(board.extend(0.0))).unwrap();
        (board, at + DVec2::new(noise(), noise()))
    };
    BoardView { points: corners.map(&mut seen).collect() }
}

const HELD: [[f64; 5]; 8] = [
    [0.0, 0.0, 0.30, 0.0, 0.0],
    [0.05, 0.03, 0.32, 0.5, 0.1],
    [-0.06, 0.02, 0.33, -0.5, 0.2],
    [0.04, -0.04, 0.35, 0.1, 0.6],
    [-0.05, -0.03, 0.34, 0.2, -0.6],
    [0.08, 0.05, 0.36, 0.4, -0.4],
    [-0.08, 0.05, 0.36, -0.4, 0.4],
    [0.07, -0.05, 0.36, -0.3, -0.3],
];

fn views(noise: &mut impl FnMut() -> f64) -> Vec<BoardView> {
    HELD.iter().map(|held| view(&truth(), *held, &mut *noise)).collect()
}

fn numbers(camera: &Calibration) -> [f64; LENS] {
    let k = camera.intrinsics();
    let c = camera.distortion().unwrap().coefficients();
    [k.fx, k.fy, k.cx, k.cy, c[0], c[1], c[2], c[3], c[4]]
}

#[test]
fn exact_points_give_the_camera_back() {
    let solved = calibrate(&views(&mut || 0.0), SIZE.0, SIZE.1).unwrap();
    assert!(solved.rmse < 1e-9, "{}", solved.rmse);
    for (found, truth) in numbers(&solved.calibration).iter().zip(numbers(&truth())) {
        assert!((found - truth).abs() < 1e-6 * truth.abs().max(1.0), "{found} {truth}");
    }
    assert!((solved.views[1].tilt - (0.5_f64.cos() * 0.1_f64.cos()).acos().to_degrees()).abs() < 1e-6);
    assert!((solved.views[1].camera_from_board.translation - DVec3::new(0.05, 0.03, 0.32)).length() < 1e-9);
}

/// Over many runs with known noise the errors are as large as the deviations say.
#[test]
fn the_deviations_are_those_of_the_errors() {
    let mut random = seeded(7);
    // The sum of twelve uniform numbers is as good as normal; 0.1 px of noise.
    let mut noise = || 0.1 * ((0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0);
    let runs = 40;
    let mut squares = [0.0; LENS];
    for _ in 0..runs {
        let solved = calibrate(&views(&mut noise), SIZE.0, SIZE.1).unwrap();
        assert!((solved.rmse - 0.1 * 2_f64.sqrt()).abs() < 0.02, "{}", solved.rmse);
        for (i, square) in squares.iter_mut().enumerate() {
            let error = numbers(&solved.calibration)[i] - numbers(&truth())[i];
            *square += (error / solved.deviations[i]).powi(2) / f64::from(runs);
        }
    }
    // The mean of 40 squares of a normal number is within 0.5 of 1 by more than two of its deviations.
    assert!(squares.iter().all(|square| (0.5..1.6).contains(square)), "{squares:?}");
}

#[test]
fn derivatives_agree_with_differences() {
    const H: f64 = 1e-6;
    let views = views(&mut || 0.3);
    let guess = start::start(&views, SIZE.0, SIZE.1).unwrap();
    let bent = SVector::from([1.0, 2.0, 3.0, 4.0, -0.2, 0.1, 0.01, 0.02, -0.03]);
    let guess = guess.moved(&bent, &vec![SVector::zeros(); views.len()]);
    // Half the cost's slope is what pulls, so it must vanish where a step of it is nought; compare along each number.
    for i in 0..LENS {
        let along = |h: f64| {
            let mut step = SVector::<f64, LENS>::zeros();
            step[i] = h;
            guess.moved(&step, &vec![SVector::zeros(); views.len()]).cost(&views)
        };
        let slope = (along(H) - along(-H)) / (2.0 * H);
        let pull = guess.system(&views).pull[i];
        assert!((slope + 2.0 * pull).abs() < 1e-4 * (1.0 + pull.abs()), "{i}: {slope} {pull}");
    }
    for i in 0..6 {
        let along = |h: f64| {
            let mut step = vec![SVector::<f64, 6>::zeros(); views.len()];
            step[2][i] = h;
            guess.moved(&SVector::zeros(), &step).cost(&views)
        };
        let slope = (along(H) - along(-H)) / (2.0 * H);
        let pull = guess.system(&views).views[2].pull[i];
        assert!((slope + 2.0 * pull).abs() < 1e-4 * (1.0 + pull.abs()), "{i}: {slope} {pull}");
    }
}

#[test]
fn views_that_do_not_tell_are_refused() {
    let mut random = seeded(3);
    let mut noise = || 0.1 * (random.random::<f64>() - 0.5);
    let two = &views(&mut noise)[..2];
    assert!(matches!(calibrate(two, 640, 480), Err(CalibrateError::TooFew { expected: 3, found: 2 })));
    let flat = |i: u32| [f64::from(i % 3) * 0.04 - 0.04, 0.0, 0.3 + 0.03 * f64::from(i), 0.0, 0.0];
    let flat: Vec<_> = (0..6).map(|i| view(&truth(), flat(i), &mut noise)).collect();
    let error = calibrate(&flat, 640, 480).unwrap_err();
    assert!(matches!(error, CalibrateError::Parallel { .. } | CalibrateError::Loose { .. }), "{error}");
    let mut line = views(&mut noise);
    line[1].points.iter_mut().for_each(|(board, _)| board.y = 0.0);
    assert!(matches!(calibrate(&line, 640, 480), Err(CalibrateError::View { view: 1, .. })));
    line[1].points.truncate(5);
    assert!(matches!(calibrate(&line, 640, 480), Err(CalibrateError::View { view: 1, expected: 6, found: 5 })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn nonsense_ends(pixels in prop::collection::vec((-1e3..2e3, -1e3..2e3), 35 * 3)) {
        let mut views = views(&mut || 0.0);
        views.truncate(3);
        let points = views.iter_mut().flat_map(|view| &mut view.points);
        for (point, (x, y)) in points.zip(pixels) {
            point.1 = DVec2::new(x, y);
        }
        if let Ok(solved) = calibrate(&views, 640, 480) {
            prop_assert!(solved.rmse.is_finite());
        }
    }
}
