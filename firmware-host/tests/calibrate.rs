//! `demeter camera calibrate` on drawn photos of a checkerboard, whose camera is known: bent, blurred, noisy, as JPEG.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use demeter::board::Board;
use demeter::files;
use demeter_frame::{Calibration, Distortion, Intrinsics, Pose, Rgb, Undistort};
use glam::{DQuat, DVec2, DVec3};
use image::imageops::blur;
use serde_json::Value;

const BOARD: Board = Board { squares: [8, 6], side: 0.03 };

fn truth() -> Calibration {
    let k = Intrinsics { width: 640, height: 480, fx: 520.0, fy: 523.0, cx: 331.0, cy: 236.0 };
    Calibration::new(k, Some(Distortion::PlumbBob { coefficients: [-0.25, 0.08, 1e-3, -8e-4, 0.0] })).unwrap()
}

/// How the board is held: its middle, metres, and how it is turned about x, y and z, radians.
type Held = ([f64; 3], [f64; 3]);

const HELD: [Held; 10] = [
    ([0.0, 0.0, 0.34], [0.0, 0.0, 0.0]),
    ([0.05, 0.03, 0.36], [0.5, 0.1, 0.1]),
    ([-0.06, 0.02, 0.37], [-0.5, 0.2, -0.2]),
    ([0.04, -0.04, 0.38], [0.1, 0.6, 0.3]),
    ([-0.05, -0.03, 0.37], [0.2, -0.6, 0.0]),
    ([0.09, 0.06, 0.40], [0.4, -0.4, 1.6]),
    ([-0.09, 0.06, 0.40], [-0.4, 0.4, 0.1]),
    ([0.09, -0.06, 0.40], [-0.3, -0.3, 0.2]),
    ([-0.09, -0.06, 0.40], [0.3, 0.3, -0.1]),
    ([0.0, 0.0, 0.42], [0.5, 0.5, 0.8]),
];

/// Three by three rays a pixel through the true lens, row by row of the finer picture.
static RAYS: LazyLock<Vec<DVec2>> = LazyLock::new(|| {
    let camera = truth();
    let ray = |i: u32| {
        let (x, y) = (f64::from(i % (3 * 640)) + 0.5, f64::from(i / (3 * 640)) + 0.5);
        camera.unproject(DVec2::new(x, y) / 3.0, 1.0).unwrap().truncate()
    };
    (0..9 * 640 * 480).map(ray).collect()
});

/// A photo through the true lens, blurred, noisy. `seen` is the share of the board, from its
/// left, that nothing stands before.
fn photo(board: &Board, (middle, [x, y, z]): &Held, seen: f64) -> Rgb {
    let turn = DQuat::from_rotation_x(*x) * DQuat::from_rotation_y(*y) * DQuat::from_rotation_z(*z);
    let board_from_camera = Pose::new(turn, DVec3::from(*middle)).inverse();
    let half = DVec2::new(f64::from(board.squares[0]), f64::from(board.squares[1])) / 2.0;
    let shade = |[x, y]: [u32; 2]| {
        let ray = board_from_camera.rotation * RAYS[(y * 3 * 640 + x) as usize].extend(1.0);
        let eye = board_from_camera.translation;
        let on = (eye - ray * (eye.z / ray.z)).truncate() / board.side + half;
        let rim = on.min(2.0 * half - on).min_element();
        if rim < -1.0 || on.x > 2.0 * half.x * seen {
            // A wall with a slow pattern.
            return 110.0 + 20.0 * (f64::from(x) / 111.0).sin() * (f64::from(y) / 69.0).cos();
        }
        let black = rim > 0.0 && (on.x.floor() + on.y.floor()).rem_euclid(2.0) == 0.0;
        if black { 35.0 } else { 215.0 }
    };
    let sharp = Rgb::from_fn(640, 480, |x, y| {
        let rays = (0..9).map(|i| [3 * x + i % 3, 3 * y + i / 3]);
        image::Rgb([(rays.map(shade).sum::<f64>() / 9.0) as u8; 3])
    });
    let mut noise = fastrand::Rng::with_seed(9);
    let mut photo = blur(&sharp, 0.8);
    for value in photo.iter_mut() {
        *value = value.saturating_add_signed(noise.i8(-4..=4));
    }
    photo
}

fn save(folder: &Path, name: &str, photo: &Rgb) -> PathBuf {
    let path = folder.join(name);
    photo.save(&path).unwrap();
    path
}

fn photos(folder: &Path, board: &Board, held: &[Held], seen: f64) -> Vec<PathBuf> {
    held.iter().enumerate().map(|(i, held)| save(folder, &format!("{i:02}.jpg"), &photo(board, held, seen))).collect()
}

fn calibrate(photos: &[PathBuf], output: &Path) -> (Option<i32>, Value) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_demeter"));
    command.args(["camera", "calibrate", "--json", "--squares", "8x6", "--square-mm", "30", "-o"]).arg(output);
    let answer = command.args(photos).output().unwrap();
    let json = serde_json::from_slice(&answer.stdout);
    (answer.status.code(), json.unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&answer.stderr))))
}

/// How far the corners of a board are from straight lines along its rows and columns, at most, pixels.
fn bend(picture: &Rgb) -> f64 {
    let corners = BOARD.find(picture).unwrap().points;
    let side = |p: f64| (p / BOARD.side).round() as i32;
    let line = |of: &dyn Fn(DVec2) -> i32, number: i32| {
        let on: Vec<_> = corners.iter().filter(|(board, _)| of(*board) == number).map(|(_, at)| *at).collect();
        if on.len() < 3 {
            return 0.0;
        }
        // The ends are the points farthest apart along the line; the middle ones are measured against them.
        let (a, b) = (on[0], on[on.len() - 1]);
        let across = (b - a).normalize().perp();
        on.iter().map(|p| across.dot(*p - a).abs()).fold(0.0, f64::max)
    };
    (0..8).map(|n| line(&|p: DVec2| side(p.x), n).max(line(&|p: DVec2| side(p.y), n))).fold(0.0, f64::max)
}

#[test]
fn photos_of_a_board_give_the_camera_back_and_its_lines_are_straight() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("side.yaml");
    let (exit, answer) = calibrate(&photos(folder.path(), &BOARD, &HELD, 1.0), &file);
    assert_eq!(exit, Some(0), "{answer}");
    let number = |key: &str| answer["intrinsics"][key].as_f64().unwrap();
    let truth = truth();
    let k = truth.intrinsics();
    for (key, truth) in [("fx", k.fx), ("fy", k.fy)] {
        assert!((number(key) / truth - 1.0).abs() < 5e-3, "{answer}");
    }
    for (key, truth) in [("cx", k.cx), ("cy", k.cy)] {
        assert!((number(key) - truth).abs() < 2.0, "{answer}");
    }
    assert!(answer["rmse_px"].as_f64().unwrap() < 0.3, "{answer}");
    let pictures = answer["pictures"].as_array().unwrap();
    assert!(pictures.len() == 10 && pictures.iter().all(|picture| picture["rmse_px"].as_f64().unwrap() < 0.3));
    assert!((pictures[1]["tilt_deg"].as_f64().unwrap() - 29.2).abs() < 1.0, "{answer}");

    // The file says the same, to those who read it as ROS does.
    let found = files::calibration(&file).unwrap();
    assert!((found.intrinsics().fx - number("fx")).abs() < 1e-6);
    assert!(std::fs::read_to_string(&file).unwrap().contains("camera_name: side\n"));
    // A view that the calibration has not seen.
    let other = photo(&BOARD, &([0.0, 0.0, 0.29], [0.15, -0.1, 0.05]), 1.0);
    let straight = Undistort::of(&found).unwrap().picture(&other).unwrap();
    assert!(bend(&other) > 2.0, "the lens bends {}", bend(&other));
    assert!(bend(&straight) < 0.4, "what is left bends {}", bend(&straight));
}

#[test]
fn what_shows_no_board_is_left_out_and_what_does_not_tell_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("side.yaml");
    let refused = |photos: &[PathBuf], kind: &str, parts: &[&str]| {
        let (exit, answer) = calibrate(photos, &file);
        assert_eq!((exit, answer["error"]["kind"].as_str()), (Some(1), Some(kind)), "{answer}");
        let message = answer["error"]["message"].as_str().unwrap();
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
        assert!(!file.exists());
    };
    let sub = |name: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir(&path).unwrap();
        path
    };
    let good = photos(&sub("good"), &BOARD, &HELD[..4], 1.0);
    refused(&good[..2], "too_few_pictures", &["at least 3", "found it in 2"]);
    let wrong = Board { squares: [7, 6], ..BOARD };
    refused(&photos(&sub("wrong"), &wrong, &HELD[..3], 1.0), "no_board", &["8x6", "7x6"]);
    let hidden = photos(&sub("hidden"), &BOARD, &HELD[..3], 0.5);
    refused(&hidden, "no_board", &["8x6 squares"]);
    let wall = photos(&sub("wall"), &BOARD, &[([9.0, 0.0, 1.0], [0.0; 3]); 3], 1.0);
    refused(&wall, "no_board", &["expected a checkerboard, found none"]);
    let flat = [0.30, 0.36, 0.42, 0.48].map(|z| ([0.0, 0.0, z], [0.0, 0.0, z]));
    let (exit, answer) = calibrate(&photos(&sub("flat"), &BOARD, &flat, 1.0), &file);
    let kind = answer["error"]["kind"].as_str();
    assert!(exit == Some(1) && matches!(kind, Some("parallel" | "loose")), "{answer}");

    // Beside good ones, bad ones cost only themselves, each with its reason.
    let small = save(folder.path(), "small.png", &Rgb::new(320, 240));
    let text = folder.path().join("text.jpg");
    std::fs::write(&text, "no picture").unwrap();
    let mixed: Vec<_> = good.iter().chain(&hidden[..1]).chain([&small, &text]).cloned().collect();
    let (exit, answer) = calibrate(&mixed, &file);
    assert_eq!(exit, Some(3), "{answer}");
    let why = |i: usize| answer["pictures"][i]["left_out"].as_str().unwrap();
    assert!(why(4).contains("8x6") && why(5).contains("found 320x240") && why(6).contains("text.jpg"), "{answer}");
    assert!(answer["pictures"][0].get("left_out").is_none() && file.exists());
}

#[test]
fn bad_use_is_told() {
    let refused = |args: &[&str]| {
        let answer =
            Command::new(env!("CARGO_BIN_EXE_demeter")).args(["camera", "calibrate"]).args(args).output().unwrap();
        assert_eq!(answer.status.code(), Some(2));
        String::from_utf8(answer.stderr).unwrap()
    };
    assert!(refused(&["a.jpg", "--squares", "8", "--square-mm", "30", "-o", "x"]).contains("8x6"));
    assert!(refused(&["a.jpg", "--squares", "8x2", "--square-mm", "30", "-o", "x"]).contains("4 to 32"));
    assert!(refused(&["a.jpg", "--squares", "8x6", "--square-mm", "nan", "-o", "x"]).contains("millimetres"));
    assert!(refused(&["--squares", "8x6", "--square-mm", "30", "-o", "x"]).contains("IMAGES"));
}
