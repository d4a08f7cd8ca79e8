//! Tracks of plants along a row; laws over random rows are in tests.rs.

use glam::DVec2;

use super::tests::SIDE;
use super::{Gate, Observation, Quality, Tracker};

#[test]
fn a_plant_seen_in_every_frame_is_one_and_closes_when_passed() {
    let mut tracker = Tracker::new(Gate::of_spacing(Some(0.2)));
    let mut closed = Vec::new();
    for f in 0..40u64 {
        let camera = 0.05 * f as f64;
        let noise = if f % 2 == 0 { 0.03 } else { -0.03 };
        let seen = (0..10).map(|i| 0.2 * f64::from(i)).filter(|x| (x - camera).abs() < 0.4);
        let seen = seen.map(|x| Observation {
            position: DVec2::new(x + noise, 0.0),
            camera: SIDE,
            quality: Quality { whole: true, pixels: 100, off_centre: (x - camera).abs() },
            view: (x, f),
        });
        closed.extend(tracker.frame(&f, camera, seen.collect()).0);
    }
    assert!(!closed.is_empty(), "the first plants are passed before the end");
    closed.extend(tracker.finish());
    assert_eq!(closed.len(), 10);
    for (i, plant) in closed.iter().enumerate() {
        assert!((plant.position.x - 0.2 * i as f64).abs() < 0.02, "{:?}", plant.position);
        assert!((0.05 * plant.best.1 as f64 - plant.best.0).abs() < 0.03, "the most central view is kept");
    }
}

#[test]
fn an_observation_without_a_place_is_given_back() {
    let mut tracker = Tracker::new(Gate(0.1));
    let quality = Quality { whole: true, pixels: 1, off_centre: 0.0 };
    let nowhere = Observation { position: DVec2::NAN, camera: SIDE, quality, view: () };
    assert_eq!(tracker.frame(&0, 0.0, vec![nowhere]).1.len(), 1);
    assert!(tracker.finish().is_empty());
}

#[test]
fn pieces_of_one_plant_in_one_frame_are_one_sight_of_the_largest() {
    let mut tracker = Tracker::new(Gate(0.1));
    let piece = |x: f64, pixels: usize| Observation {
        position: DVec2::new(x, 0.0),
        camera: SIDE,
        quality: Quality { whole: true, pixels, off_centre: 0.0 },
        view: pixels,
    };
    tracker.frame(&0, 0.0, vec![piece(0.05, 10), piece(0.0, 90), piece(0.5, 40)]);
    let closed = tracker.finish();
    let told: Vec<(f64, usize, usize)> = closed.iter().map(|c| (c.position.x, c.best, c.frames.len())).collect();
    assert_eq!(told, [(0.005, 90, 1), (0.5, 40, 1)], "two plants; the piece moves its plant by its share of pixels");
}

#[test]
fn a_wrong_depth_leaves_the_track_later_than_a_wrong_direction() {
    let tracks = |second: DVec2| {
        let mut tracker = Tracker::new(Gate(0.1));
        for (frame, position) in [(0, DVec2::ZERO), (1, second)] {
            let quality = Quality { whole: true, pixels: 9, off_centre: 0.0 };
            tracker.frame(
                &frame,
                0.0,
                vec![Observation { position, camera: DVec2::new(0.0, -1.0), quality, view: () }],
            );
        }
        tracker.finish().len()
    };
    assert_eq!(tracks(DVec2::new(0.0, 0.25)), 1, "behind it by a quarter of its distance");
    assert_eq!(tracks(DVec2::new(0.25, 0.0)), 2, "beside it by as much");
    assert_eq!(tracks(DVec2::new(0.0, 0.5)), 2, "far behind it");
}
