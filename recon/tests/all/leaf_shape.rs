//! Laws of learning leaf shapes: outlines, grids and the rule that rejects scans.

use std::f64::consts::{PI, TAU};

use approx::assert_relative_eq;
use demeter_recon::learn::shape::{FlatLeaf, GridKind, contour_error, equally_wide, learn, left_out, widthless};
use demeter_recon::learn::{Ends, Outline, OutlineError, PcaError, Rejection, folded, harmonic, oval, rejections};
use demeter_recon::model::leaf::{COLUMNS, ROWS, Side, node};
use demeter_recon::species;
use glam::{DVec2, IVec2};
use image::{GrayImage, Luma};
use proptest::prelude::*;

/// A closed contour of `n` points around the origin whose radius at an angle is given, base below and tip above.
fn around(n: usize, radius: impl Fn(f64) -> f64) -> Vec<DVec2> {
    let angle = |k: usize| TAU * k as f64 / n as f64 - PI / 2.0;
    (0..n).map(|k| radius(angle(k)) * DVec2::from_angle(angle(k))).collect()
}

/// An ellipse `width` as wide as long.
fn ellipse(width: f64) -> Vec<DVec2> {
    around(400, |a| 0.5 * width / DVec2::new(a.cos(), width * a.sin()).length())
}

fn outline(contour: &[DVec2]) -> Outline {
    Outline::new(contour, 0, contour.len() / 2).unwrap()
}

/// A mask of `size` with the pixels whose middle, from the picture's middle and y up, is leaf.
fn mask(size: u32, leaf: impl Fn(DVec2) -> bool) -> GrayImage {
    let middle = DVec2::splat(f64::from(size) / 2.0);
    GrayImage::from_fn(size, size, |x, y| {
        let p = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) - middle;
        Luma([if leaf(DVec2::new(p.x, -p.y)) { 255 } else { 0 }])
    })
}

fn in_ellipse(p: DVec2, half: DVec2) -> bool {
    (p / half).length_squared() <= 1.0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Radó-Kneser-Choquet: lobes of any number, the tip on one of them, twisted so that the leaf is not star-shaped.
    #[test]
    fn harmonic_grids_never_fold(
        lobes in 1u32..7, depth in 0.0..0.3f64, teeth in 0.0..0.03f64, swirl in -0.7..0.7f64,
    ) {
        let radius = |a: f64| {
            0.5 * (1.0 + depth * (f64::from(lobes) * (a - PI / 2.0)).cos() + teeth * (40.0 * a).sin())
        };
        let contour: Vec<DVec2> =
            around(800, radius).iter().map(|p| DVec2::from_angle(swirl * p.length_squared()).rotate(*p)).collect();
        let outline = outline(&contour);
        let grid = harmonic(&outline).unwrap();
        prop_assert_eq!(folded(&grid), 0);
        prop_assert!(grid.iter().all(|p| p.is_finite()));
        // The edge lies on the contour at the shares of its length that the disc says.
        for i in 1..ROWS - 1 {
            let t = (1.0 - 2.0 * i as f64 / 44.0).acos() / PI;
            prop_assert!(grid[node(i, 42)].distance(outline.at(Side::Right, t)) < 1e-12);
            prop_assert!(grid[node(i, 0)].distance(outline.at(Side::Left, t)) < 1e-12);
        }
    }

    #[test]
    fn outlines_do_not_depend_on_place_size_turn_or_direction(
        angle in 0.0..TAU, scale in 0.01..1e4f64, x in -1e3..1e3f64, width in 0.2..1.5f64,
    ) {
        let contour = ellipse(width);
        let (moved, expected): (Vec<DVec2>, _) = (
            contour.iter().map(|p| scale * DVec2::from_angle(angle).rotate(*p) + DVec2::new(x, -x)).collect(),
            outline(&contour),
        );
        let mut turned = moved.clone();
        turned.reverse();
        let last = turned.len() - 1;
        for found in [outline(&moved), Outline::new(&turned, last, last - 200).unwrap()] {
            for (a, b) in found.polygon().iter().zip(expected.polygon()) {
                prop_assert!(a.distance(b) < 1e-9);
            }
        }
    }

    #[test]
    fn oval_grids_are_the_contour_at_their_edges(width in 0.1..1.4f64) {
        let grid = oval(&outline(&ellipse(width))).unwrap();
        prop_assert_eq!(folded(&grid), 0);
        for i in 1..ROWS - 1 {
            let y = i as f64 / 44.0;
            let half = width * (y * (1.0 - y)).sqrt();
            prop_assert!((grid[node(i, 42)] - DVec2::new(half, y)).length() < 1e-3);
            prop_assert!((grid[node(i, 0)] - DVec2::new(-half, y)).length() < 1e-3);
            let step = grid[node(i, 1)] - grid[node(i, 0)];
            prop_assert!((grid[node(i, 42)] - grid[node(i, 41)] - step).length() < 1e-12);
        }
        prop_assert!(contour_error(&outline(&ellipse(width)), &grid) < 2e-3);
    }
}

#[test]
fn a_harmonic_grid_of_the_disc_is_the_disc() {
    let grid = harmonic(&outline(&ellipse(1.0))).unwrap();
    for (i, j) in (1..ROWS - 1).flat_map(|i| (0..COLUMNS).map(move |j| (i, j))) {
        let v = i as f64 / 44.0;
        let expected = DVec2::new((j as f64 / 21.0 - 1.0) * (v * (1.0 - v)).sqrt(), v);
        // A polygon of 88 corners stands for the circle, hence not less.
        assert!(grid[node(i, j)].distance(expected) < 2e-3, "({i}, {j}): {} {expected}", grid[node(i, j)]);
    }
}

#[test]
fn traced_ellipses_have_their_size_wherever_the_base_is() {
    for (ends, half) in [
        (Ends::Top, DVec2::new(60.0, 100.0)),
        (Ends::Bottom, DVec2::new(60.0, 100.0)),
        (Ends::Left, DVec2::new(100.0, 60.0)),
        (Ends::Right, DVec2::new(100.0, 60.0)),
        (Ends::Auto, DVec2::new(60.0, 100.0)),
    ] {
        let traced = Outline::trace(&mask(256, |p| in_ellipse(p, half)), ends).unwrap();
        assert_eq!((traced.others, traced.on_edge), (0.0, 0.0));
        let grid = oval(&traced.outline).unwrap();
        assert!(contour_error(&outline(&ellipse(0.6)), &grid) < 2e-3, "{ends:?}");
        // Smoothing must not shrink: the area is the ellipse's within a thousandth.
        let polygon = traced.outline.polygon();
        let area: f64 = (0..polygon.len()).map(|i| polygon[i].perp_dot(polygon[(i + 1) % polygon.len()]) / 2.0).sum();
        assert_relative_eq!(area, PI * 0.3 * 0.5, max_relative = 5e-3);
    }
}

#[test]
fn the_upper_side_is_the_one_seen() {
    // Base at the bottom of the picture, a bulge to the viewer's right: x > 0 with the tip ahead.
    let bulge = |p: DVec2| in_ellipse(p, DVec2::new(if p.x > 0.0 { 80.0 } else { 40.0 }, 100.0));
    let outline = |ends| Outline::trace(&mask(256, bulge), ends).unwrap().outline;
    let width = |ends, side| outline(ends).at(side, 0.5).x.abs();
    assert!(width(Ends::Bottom, Side::Right) > 1.5 * width(Ends::Bottom, Side::Left));
    assert!(width(Ends::Top, Side::Left) > 1.5 * width(Ends::Top, Side::Right));
}

#[test]
fn petioles_are_cut_off_and_tell_the_base() {
    let blade = |p: DVec2| in_ellipse(p - DVec2::new(0.0, 40.0), DVec2::new(60.0, 80.0));
    let with = mask(300, |p| blade(p) || (p.x.abs() < 4.0 && p.y > -140.0 && p.y < 0.0));
    for ends in [Ends::Auto, Ends::Bottom] {
        let traced = Outline::trace(&with, ends).unwrap();
        let grid = oval(&traced.outline).unwrap();
        assert!(contour_error(&outline(&ellipse(0.75)), &grid) < 8e-3, "{ends:?}");
    }
    // Seen from the other end it is a leaf's thin tip, and stays.
    let upside_down = Outline::trace(&with, Ends::Top).unwrap().outline;
    assert!(upside_down.polygon().iter().map(|p| p.x).fold(0.0, f64::max) < 0.3);
}

#[test]
fn what_is_no_leaf_is_refused() {
    let small = |found| Err(OutlineError::Small { expected: 300, found });
    let trace = |mask: &GrayImage| Outline::trace(mask, Ends::Auto).map(|_| ());
    assert_eq!(trace(&mask(64, |_| false)), small(0));
    assert_eq!(trace(&GrayImage::new(0, 0)), small(0));
    assert_eq!(trace(&mask(65, |p| p.as_ivec2() == IVec2::ZERO && p.length() < 0.1)), small(1));
    assert!(trace(&mask(64, |_| true)).is_ok(), "a full picture is a square, which the rule rejects as cut");
    let eight: Vec<DVec2> =
        (0..200).map(|k| TAU * k as f64 / 200.0).map(|a| DVec2::new((2.0 * a).sin(), a.cos())).collect();
    assert_eq!(Outline::new(&eight, 100, 0), Err(OutlineError::Crossed));
    assert_eq!(Outline::new(&ellipse(0.5), 3, 3), Err(OutlineError::Degenerate));
    assert_eq!(Outline::new(&[], 0, 0), Err(OutlineError::Degenerate));
    assert_eq!(Outline::new(&[DVec2::NAN; 9], 0, 3), Err(OutlineError::Degenerate));
    let flat: Vec<DVec2> = (0..40).map(|k| DVec2::new(0.0, f64::from(20 - (k - 20i32).abs()))).collect();
    assert_eq!(Outline::new(&flat, 0, 20), Err(OutlineError::Crossed));
    let heart = around(400, |a| 0.5 - 0.4 * (a + PI / 2.0).cos());
    assert!(oval(&outline(&heart)).is_err_and(|error| error == OutlineError::NotOval));
}

#[test]
fn the_rule_rejects_what_is_broken_and_keeps_the_rest() {
    let half = |k: u32| DVec2::new(55.0 + f64::from(k % 5), 90.0 + f64::from(k % 7));
    let trace = |leaf: &dyn Fn(DVec2) -> bool| Outline::trace(&mask(256, leaf), Ends::Bottom).unwrap();
    let mut scans: Vec<_> = (0..20).map(|k| trace(&|p| in_ellipse(p, half(k)))).collect();
    assert!(rejections(&scans).iter().all(Option::is_none));
    scans.extend([
        trace(&|p| in_ellipse(p, half(1)) && p.distance(DVec2::new(60.0, 10.0)) > 25.0),
        trace(&|p| in_ellipse(p, half(1)) || p.distance(DVec2::new(100.0, 100.0)) < 20.0),
        trace(&|p| in_ellipse(p - DVec2::new(90.0, 0.0), half(1))),
        trace(&|p| in_ellipse(p, DVec2::new(120.0, 40.0))),
    ]);
    let reasons = rejections(&scans);
    assert!(reasons[..20].iter().all(Option::is_none));
    assert!(matches!(reasons[20], Some(Rejection::Outlier { .. })), "{:?}", reasons[20]);
    assert!(matches!(reasons[21], Some(Rejection::Others { .. })), "{:?}", reasons[21]);
    assert!(matches!(reasons[22], Some(Rejection::Cut { .. })), "{:?}", reasons[22]);
    assert!(matches!(reasons[23], Some(Rejection::Axis { .. })), "{:?}", reasons[23]);
}

#[test]
fn learned_shapes_keep_base_and_tip_and_foretell_leaves_they_have_not_seen() {
    let related = species::shipped("soybean").unwrap().unwrap().leaf.shape;
    let leaf = |k: usize| FlatLeaf::new(&outline(&ellipse(0.4 + 0.01 * k as f64)), GridKind::Oval).unwrap();
    let leaves: Vec<FlatLeaf> = (0..40).map(leaf).collect();
    let refs: Vec<&FlatLeaf> = leaves.iter().collect();
    let learned = learn(&refs, &related, 5).unwrap();
    let flat = learned.basis.at(&[3.0; 5]);
    for j in 0..COLUMNS {
        assert_eq!([flat[2 * node(0, j)], flat[2 * node(0, j) + 1]], [0.0, 0.0]);
        assert_eq!([flat[2 * node(44, j)], flat[2 * node(44, j) + 1]], [0.0, 1.0]);
    }
    // One number tells these leaves apart, so one component does, also for those that were left out.
    let errors = left_out(&leaves, &related, 1, 5).unwrap();
    let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
    assert!(worst(&errors[0]) > 0.05 && worst(&errors[1]) < 2e-3, "{} {}", worst(&errors[0]), worst(&errors[1]));
    // Equally wide, they are one leaf, and only a related species has components.
    let same = equally_wide(&leaves);
    assert!(contour_error(&same[0].outline, &same[39].grid) < 3e-3);
    // The width's own direction is gone from what is left of a grass's components.
    let grass = widthless(&species::generic("maize").unwrap().unwrap().leaf.shape).unwrap();
    let by_width = grass.mean().iter().enumerate().map(|(k, x)| if k % 2 == 0 { *x } else { 0.0 });
    let by_width = nalgebra::DVector::from_iterator(grass.dim(), by_width);
    assert!((grass.components() * by_width).amax() < 1e-9);
    let few: Vec<&FlatLeaf> = same.iter().take(2).collect();
    assert_eq!(learn(&few, &related, 5).unwrap().basis.rank(), 5);
    assert_eq!(learn(&[], &related, 5).unwrap_err(), PcaError::Samples { expected: 1, found: 0 });
}
