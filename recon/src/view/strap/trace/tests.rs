//! Strokes painted, traced back.

use super::*;
use image::{GrayImage, Luma};

/// A brush stroke along a quadratic Bézier curve, its half width falling from `radius` to nothing at the end.
fn stroke(picture: &mut GrayImage, [a, b, c]: [DVec2; 3], radius: f64, taper: f64) {
    for k in 0..=2000 {
        let t = f64::from(k) / 2000.0;
        let at = a.lerp(b, t).lerp(b.lerp(c, t), t);
        let r = radius * (1.0 - taper * t);
        for y in (at.y - r).floor() as i32..=(at.y + r).ceil() as i32 {
            for x in (at.x - r).floor() as i32..=(at.x + r).ceil() as i32 {
                let inside = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5).distance(at) <= r;
                if inside && x >= 0 && y >= 0 && (x as u32) < picture.width() && (y as u32) < picture.height() {
                    picture.put_pixel(x as u32, y as u32, Luma([255]));
                }
            }
        }
    }
}

/// An upright stem with strap leaves: (height of the node, reach to the right, rise, fall of the tip below its top).
fn maize(leaves: &[(f64, f64, f64, f64)]) -> (GrayImage, Vec<f64>) {
    let mut picture = GrayImage::new(400, 440);
    let foot = DVec2::new(200.0, 420.0);
    let top = leaves.iter().map(|leaf| leaf.0).fold(0.0, f64::max);
    stroke(&mut picture, [foot, foot - DVec2::Y * top / 2.0, foot - DVec2::Y * top], 6.0, 0.3);
    let mut lengths = Vec::new();
    for &(node, reach, rise, fall) in leaves {
        let from = foot - DVec2::Y * node;
        let curve = [from, from + DVec2::new(reach * 0.5, -2.0 * rise), from + DVec2::new(reach, fall - rise)];
        stroke(&mut picture, curve, 4.0, 0.8);
        let at = |t: f64| curve[0].lerp(curve[1], t).lerp(curve[1].lerp(curve[2], t), t);
        lengths.push((0..100).map(|k| at(f64::from(k) / 100.0).distance(at(f64::from(k + 1) / 100.0))).sum());
    }
    (picture, lengths)
}

fn length(stroke: &Stroke) -> f64 {
    let few: Vec<DVec2> = stroke.points.iter().copied().step_by(5).chain(stroke.points.last().copied()).collect();
    few.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

#[test]
fn leaves_are_counted_and_measured_lowest_first() {
    let (picture, lengths) = maize(&[
        (80.0, 120.0, 60.0, 40.0),
        (140.0, -130.0, 70.0, 60.0),
        (200.0, 110.0, 70.0, 20.0),
        (260.0, -60.0, 100.0, 0.0),
        (262.0, 40.0, 120.0, 0.0),
    ]);
    let sketch = Sketch::of(&Silhouette::of(&picture)).unwrap();
    assert_eq!(sketch.blades.len(), lengths.len());
    assert!((sketch.stem.points[0].x - 200.0).abs() < 5.0 && sketch.stem.points[0].y > 400.0);
    for (blade, expected) in sketch.blades.iter().zip(&lengths).take(3) {
        let found = length(blade);
        assert!((found / expected - 1.0).abs() < 0.1, "{found} instead of {expected}");
    }
}

#[test]
fn blades_go_straight_over_crossings() {
    // The lower leaf's arch is crossed by the hanging tip of the upper one, well off the stem.
    let (picture, lengths) = maize(&[
        (60.0, 160.0, 110.0, 60.0),
        (200.0, 160.0, 10.0, 160.0),
        (240.0, -60.0, 100.0, 0.0),
        (242.0, 40.0, 120.0, 0.0),
    ]);
    let sketch = Sketch::of(&Silhouette::of(&picture)).unwrap();
    assert_eq!(sketch.blades.len(), 4);
    let found: Vec<f64> = sketch.blades.iter().map(length).collect();
    for (found, expected) in found.iter().zip(&lengths).take(2) {
        assert!((found / expected - 1.0).abs() < 0.12, "{found} instead of {expected}");
    }
}

#[test]
fn holes_between_blades_add_none() {
    let leaves = [
        (80.0, 120.0, 60.0, 40.0),
        (140.0, -130.0, 70.0, 60.0),
        (200.0, 160.0, 60.0, 40.0),
        (260.0, -60.0, 100.0, 0.0),
        (262.0, 40.0, 120.0, 0.0),
    ];
    let (mut picture, lengths) = maize(&leaves);
    // From a blade's rise to its fall.
    let ends = [DVec2::new(248.0, 168.0), DVec2::new(328.0, 169.0)];
    stroke(&mut picture, [ends[0], ends[0].midpoint(ends[1]), ends[1]], 3.0, 0.0);
    let sketch = Sketch::of(&Silhouette::of(&picture)).unwrap();
    assert_eq!(sketch.blades.len(), lengths.len());
}

#[test]
fn a_thin_foot_under_a_thick_whorl_is_the_stems() {
    let (mut picture, _) = maize(&[(60.0, 150.0, 60.0, 40.0), (120.0, -150.0, 70.0, 60.0), (200.0, 120.0, 90.0, 20.0)]);
    let whorl = [DVec2::new(200.0, 230.0), DVec2::new(204.0, 160.0), DVec2::new(212.0, 90.0)];
    stroke(&mut picture, whorl, 15.0, 0.9);
    let sketch = Sketch::of(&Silhouette::of(&picture)).unwrap();
    let foot = sketch.stem.points[0];
    assert!(foot.distance(DVec2::new(200.0, 420.0)) < 12.0, "the stem begins at {foot}");
    assert_eq!(sketch.blades.len(), 4);
}

#[test]
fn what_has_no_stem_with_blades_is_no_grass() {
    let mut disc = GrayImage::new(100, 100);
    stroke(&mut disc, [DVec2::splat(50.0); 3], 30.0, 0.0);
    let mut bar = GrayImage::new(100, 100);
    stroke(&mut bar, [DVec2::new(50.0, 90.0), DVec2::new(50.0, 50.0), DVec2::new(50.0, 10.0)], 4.0, 0.0);
    for picture in [disc, bar, GrayImage::new(100, 100), GrayImage::new(0, 0), GrayImage::from_pixel(3, 9, Luma([1]))] {
        assert_eq!(Sketch::of(&Silhouette::of(&picture)), None);
    }
    // Noise has more lines than any plant, and must not take longer.
    let mut rng = crate::world::seeded(1);
    let noise = GrayImage::from_fn(400, 400, |_, _| Luma([u8::from(rand::Rng::random_bool(&mut rng, 0.4))]));
    assert_eq!(Sketch::of(&Silhouette::of(&noise)), None);
}
