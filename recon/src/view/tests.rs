//! On scenes drawn here by hand, with known distances; tests/view.rs uses the renderer's plants.

use std::collections::BTreeSet;

use demeter_frame::{Instances, Pose, Semantic};
use glam::{DVec2, DVec3};
use image::{ImageBuffer, Luma};
use proptest::prelude::*;

use super::*;
use crate::organs::ScaleSource;

/// A picture of flat pieces, nearer ones drawn last.
struct Scene {
    semantic: GrayImage,
    truth: Instances,
    log_depth: Depth,
    intrinsics: Intrinsics,
    count: u16,
}

impl Scene {
    fn new() -> Self {
        let intrinsics = Intrinsics::from_hfov(320, 240, 1.0);
        Self {
            semantic: GrayImage::new(320, 240),
            truth: ImageBuffer::new(320, 240),
            log_depth: ImageBuffer::from_pixel(320, 240, Luma([2f32.ln()])),
            intrinsics,
            count: 0,
        }
    }

    fn rectangle(mut self, class: Semantic, [x0, y0, x1, y1]: [u32; 4], depth: f32) -> Self {
        self.count += 1;
        for (x, y) in (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))) {
            self.semantic.put_pixel(x, y, Luma([class as u8]));
            self.truth.put_pixel(x, y, Luma([self.count]));
            self.log_depth.put_pixel(x, y, Luma([depth.ln()]));
        }
        self
    }

    /// t = δ / max(d, δ) with δ = 2 pixels, by looking at all pixels within 8.
    fn dist(&self) -> Mask {
        ImageBuffer::from_fn(320, 240, |x, y| {
            let own = self.truth.get_pixel(x, y).0[0];
            let mut nearest = f64::INFINITY;
            for (i, j) in (y.saturating_sub(8)..(y + 9).min(240))
                .flat_map(|j| (x.saturating_sub(8)..(x + 9).min(320)).map(move |i| (i, j)))
            {
                let other = self.truth.get_pixel(i, j).0[0];
                if other != own && other != 0 {
                    nearest = nearest.min(f64::from(i.abs_diff(x)).hypot(f64::from(j.abs_diff(y))));
                }
            }
            Luma([if own == 0 { 0.0 } else { (2.0 / nearest.max(2.0)) as f32 }])
        })
    }

    fn with<T>(&self, pose: Option<Pose>, f: impl FnOnce(&View<'_>) -> T) -> T {
        let dist = self.dist();
        let view = View {
            semantic: &self.semantic,
            dist: &dist,
            log_depth: &self.log_depth,
            intrinsics: self.intrinsics,
            world_from_camera: pose,
        };
        f(&view.validated().unwrap())
    }
}

/// Two plants of a main stem and two leaves each; the leaves of the first cross in the picture.
fn two_plants() -> Scene {
    use Semantic::{Leaf, MainStem};
    Scene::new()
        .rectangle(MainStem, [60, 80, 66, 200], 1.0)
        .rectangle(Leaf, [66, 90, 130, 106], 1.0)
        .rectangle(Leaf, [66, 106, 126, 124], 0.99)
        .rectangle(MainStem, [220, 80, 226, 200], 1.0)
        .rectangle(Leaf, [160, 90, 220, 106], 1.0)
        .rectangle(Leaf, [226, 100, 290, 116], 1.0)
}

#[test]
fn touching_leaves_come_apart_and_every_instance_matches_its_truth() {
    let scene = two_plants();
    scene.with(None, |view| {
        let (raster, regions) = instances(view);
        assert_eq!(regions.len(), 6);
        for region in &regions {
            let mut overlap = [0usize; 7];
            for (found, truth) in raster.pixels().zip(scene.truth.pixels()) {
                overlap[usize::from(truth.0[0])] += usize::from(found.0[0] == region.id);
            }
            let (truth, &common) = overlap.iter().enumerate().max_by_key(|&(_, n)| n).unwrap();
            let size = scene.truth.pixels().filter(|p| usize::from(p.0[0]) == truth).count();
            let iou = common as f64 / (size + region.pixels - common) as f64;
            assert!(iou > 0.95, "region {region:?}: {iou}");
        }
        // Without the boundary distance the touching leaves are one: the test can fail.
        let far = Mask::new(320, 240);
        let blind = View { dist: &far, ..*view };
        assert_eq!(instances(&blind).1.iter().filter(|r| r.pixels > 2000).count(), 1);
    });
}

#[test]
fn organs_go_to_the_plant_they_touch() {
    let plants = two_plants().with(None, |view| {
        let (raster, regions) = instances(view);
        let scale = nominal(view).unwrap();
        let lifted = lift(view, &raster, &regions, scale);
        assert_eq!(lifted.dropped, []);
        let (plants, refused) = group(view, &lifted.organs);
        assert_eq!(refused, []);
        plants
    });
    assert_eq!(plants.len(), 2);
    for plant in &plants {
        assert_eq!(plant.organs.len(), 3);
        assert!(!plant.stand_in && !plant.touches_border);
        let left = plant.organs[0].points[0].x < 0.0;
        assert!(plant.organs.iter().all(|o| o.points.iter().all(|p| (p.x < 0.0) == left)));
        assert!(plant.base.y > 0.25, "the base is at the bottom: {}", plant.base);
    }
}

#[test]
fn a_stem_cut_by_a_leaf_is_one_and_a_lone_leaf_is_a_plant_in_a_photo_unless_it_is_small() {
    use Semantic::{Leaf, MainStem};
    let scene = |alone: [u32; 4]| {
        Scene::new()
            .rectangle(MainStem, [100, 60, 106, 220], 1.0)
            .rectangle(Leaf, [20, 120, 200, 150], 0.95)
            .rectangle(Leaf, alone, 1.0)
    };
    let grouped = |scene: &Scene, in_row: bool| {
        scene.with(None, |view| {
            let (raster, regions) = instances(view);
            assert_eq!(regions.len(), 4);
            let lifted = lift(view, &raster, &regions, nominal(view).unwrap());
            assert_eq!(lifted.dropped, []);
            let above = Pose::looking_at(DVec3::Z, DVec3::new(0.0, 0.5, 0.0), DVec3::Z);
            let view = View { world_from_camera: in_row.then_some(above), ..*view };
            let (plants, refused) = group(&view, &lifted.organs);
            let organs: Vec<usize> = plants.iter().map(|plant| plant.organs.len()).collect();
            (organs, refused.into_iter().map(|refused| refused.reason).collect::<Vec<_>>())
        })
    };
    let seedling = scene([260, 20, 300, 40]);
    // Its stem is a stand-in.
    assert_eq!(grouped(&seedling, false), (vec![2, 2], vec![]));
    assert_eq!(grouped(&seedling, true), (vec![2], vec![GroupError::NoMainStem]));
    assert_eq!(grouped(&scene([260, 20, 272, 28]), false), (vec![2], vec![GroupError::NoMainStem]));
}

#[test]
fn a_strap_in_two_pieces_is_one_leaf_and_leaflets_side_by_side_are_not() {
    use Semantic::{Leaf, MainStem};
    let strap = Scene::new()
        .rectangle(MainStem, [60, 60, 66, 220], 1.0)
        .rectangle(Leaf, [66, 100, 130, 108], 1.0)
        .rectangle(Leaf, [134, 100, 200, 108], 1.05);
    let beside = Scene::new()
        .rectangle(MainStem, [60, 60, 66, 220], 1.0)
        .rectangle(Leaf, [66, 100, 100, 130], 1.0)
        .rectangle(Leaf, [104, 100, 140, 130], 1.0);
    for (scene, organs) in [(strap, 2), (beside, 3)] {
        scene.with(None, |view| {
            let (raster, regions) = instances(view);
            assert_eq!(regions.len(), 3);
            let lifted = lift(view, &raster, &regions, nominal(view).unwrap());
            let (plants, refused) = group(view, &lifted.organs);
            assert_eq!((plants.len(), refused.len(), plants[0].organs.len()), (1, 0, organs));
        });
    }
}

#[test]
fn a_rosette_gets_a_stand_in_stem_between_its_leaves() {
    use Semantic::Leaf;
    let scene = Scene::new().rectangle(Leaf, [60, 100, 118, 120], 1.0).rectangle(Leaf, [122, 100, 180, 120], 1.0);
    scene.with(None, |view| {
        let (raster, regions) = instances(view);
        let lifted = lift(view, &raster, &regions, nominal(view).unwrap());
        let (plants, _) = group(view, &lifted.organs);
        assert_eq!((plants.len(), plants[0].organs.len(), plants[0].stand_in), (1, 3, true));
        let middle = view.intrinsics.unproject(DVec2::new(120.0, 110.0), 1.0);
        assert!((plants[0].base.x - middle.x).abs() < 0.02, "{} {middle}", plants[0].base);
    });
}

#[test]
fn depth_edges_and_specks_are_dropped_and_counted() {
    let mut scene = Scene::new().rectangle(Semantic::Leaf, [60, 100, 120, 130], 1.0).rectangle(
        Semantic::Leaf,
        [200, 100, 204, 105],
        1.0,
    );
    for y in 100..130 {
        scene.log_depth.put_pixel(119, y, Luma([0.5]));
    }
    scene.with(None, |view| {
        let (raster, regions) = instances(view);
        let lifted = lift(view, &raster, &regions, nominal(view).unwrap());
        assert_eq!(lifted.organs.len(), 1);
        let columns = lifted.organs[0].cloud.source.iter().map(|p| p % 320);
        assert_eq!(columns.max(), Some(118), "the column behind the jump is not the leaf's");
        let reasons: Vec<_> = lifted.dropped.iter().map(|d| d.reason).collect();
        assert_eq!(reasons, [DropReason::Narrow, DropReason::FewPoints]);
    });
}

/// A camera 1.5 m high that looks down at 45 degrees, and the depth of the ground it sees.
fn over_the_ground() -> (Scene, Pose) {
    let pose = Pose::looking_at(DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.0, 1.5, 0.0), DVec3::Z);
    let mut scene = Scene::new();
    for (x, y, pixel) in scene.log_depth.enumerate_pixels_mut() {
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let ray = pose.rotation * scene.intrinsics.unproject(at, 1.0);
        pixel.0[0] = (-1.5 / ray.z).ln() as f32;
    }
    (scene, pose)
}

#[test]
fn the_ground_gives_metres_whatever_constant_the_network_adds() {
    let (mut scene, pose) = over_the_ground();
    for shift in [0.0, -2.0, 3.0] {
        for pixel in scene.log_depth.pixels_mut() {
            pixel.0[0] += shift;
        }
        let scale = scene.with(Some(pose), ground_plane).unwrap();
        assert_eq!(scale.source, ScaleSource::GroundPlane);
        for pixel in scene.log_depth.pixels_mut() {
            pixel.0[0] -= shift;
        }
        assert!((scale.factor.ln() + f64::from(shift)).abs() < 1e-4, "{scale:?}");
    }
    assert_eq!(scene.with(None, ground_plane), Err(ScaleError::NoPose));
    // A network that tells only half of the range, with plants before the ground, which are no ground.
    let mut narrow = over_the_ground().0;
    narrow.log_depth.pixels_mut().for_each(|pixel| pixel.0[0] = 0.5 * pixel.0[0] + 0.3);
    let scale = narrow.with(Some(pose), ground_plane).unwrap();
    assert!((scale.exponent - 2.0).abs() < 1e-3 && (scale.factor.ln() + 0.6).abs() < 1e-3, "{scale:?}");
    for (i, pixel) in scene.log_depth.pixels_mut().enumerate() {
        pixel.0[0] += (i % 7) as f32;
    }
    assert!(matches!(scene.with(Some(pose), ground_plane), Err(ScaleError::Spread { .. })));
    let full = scene.rectangle(Semantic::Leaf, [0, 0, 320, 240], 1.0);
    assert!(matches!(full.with(Some(pose), ground_plane), Err(ScaleError::FewPixels { found: 0, .. })));
}

#[test]
fn an_impossible_view_is_refused_by_name() {
    let scene = Scene::new();
    let small = Mask::new(10, 10);
    scene.with(None, |view| {
        let error = View { dist: &small, ..*view }.validated().unwrap_err();
        assert!(error.to_string().contains("dist"), "{error}");
        let nan = Pose { translation: DVec3::NAN, ..Pose::IDENTITY };
        assert!(matches!(View { world_from_camera: Some(nan), ..*view }.validated(), Err(ViewError::Pose { .. })));
    });
}

/// A camera far beside a row along x.
pub(super) const SIDE: DVec2 = DVec2::new(1.0, -1e6);

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever a network says, also NaN and infinities, ends in finite points or in none.
    #[test]
    fn noise_gives_finite_plants_or_none(seed in any::<u64>(), flat in any::<bool>()) {
        use rand::{Rng, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let (w, h) = (rng.random_range(1..64u32), rng.random_range(1..64u32));
        let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -200.0, 200.0, 0.0, 0.01, 0.5, 1.0];
        let block = rng.random_range(1..16);
        let classes: Vec<u8> = (0..4096).map(|_| rng.random_range(0..6)).collect();
        let semantic = GrayImage::from_fn(w, h, |x, y| Luma([classes[(y / block * 64 + x / block) as usize]]));
        let mut raster = || Mask::from_fn(w, h, |_, _| {
            Luma([if flat { 0.1 } else { values[rng.random_range(0..values.len())] }])
        });
        let (dist, log_depth) = (raster(), raster());
        let intrinsics = Intrinsics::from_hfov(w, h, 1.0);
        let view = View { semantic: &semantic, dist: &dist, log_depth: &log_depth, intrinsics, world_from_camera: None };
        let Ok(view) = view.validated() else { return Ok(()) };
        let (raster, regions) = instances(&view);
        prop_assert_eq!(raster.pixels().map(|p| p.0[0]).max().map(usize::from), Some(regions.len()));
        if let Ok(scale) = nominal(&view) {
            let lifted = lift(&view, &raster, &regions, scale);
            prop_assert_eq!(lifted.organs.len() + lifted.dropped.len(), regions.len());
            let (plants, refused) = group(&view, &lifted.organs);
            let told = plants.iter().map(|p| p.instances.len()).sum::<usize>()
                + refused.iter().map(|r| r.instances.len()).sum::<usize>();
            prop_assert_eq!(told, lifted.organs.len(), "every organ belongs to one plant or one refusal");
            prop_assert!(plants.iter().flat_map(|p| &p.organs).flat_map(|o| &o.points).all(|p| p.is_finite()));
        }
    }

    /// Every observation ends in one track, pieces of one plant in one frame count once, the best view is the best,
    /// and the order within frames is nothing.
    #[test]
    fn tracking_loses_nothing_and_ignores_the_order(
        frames in prop::collection::vec(prop::collection::vec((0.0..3.0f64, 0..1000usize, any::<bool>()), 0..6), 1..20),
    ) {
        let run = |reverse: bool| {
            let mut tracker = Tracker::new(Gate(0.1));
            let mut closed = Vec::new();
            let mut id = 0;
            for (f, plants) in frames.iter().enumerate() {
                let mut seen: Vec<Observation<(usize, usize, bool)>> = Vec::new();
                for &(x, pixels, whole) in plants {
                    let quality = Quality { whole, pixels, off_centre: 0.0 };
                    seen.push(Observation { position: DVec2::new(x, 0.0), camera: SIDE, quality, view: (id, pixels, whole) });
                    id += 1;
                }
                if reverse {
                    seen.reverse();
                }
                let (now, lost) = tracker.frame(&f, 0.2 * f as f64, seen);
                assert!(lost.is_empty());
                closed.extend(now);
            }
            closed.extend(tracker.finish());
            closed
        };
        let closed = run(false);
        prop_assert_eq!(&closed, &run(true));
        let observed: usize = frames.iter().map(Vec::len).sum();
        prop_assert!(closed.iter().map(|c| c.frames.len()).sum::<usize>() <= observed);
        let told: BTreeSet<usize> = closed.iter().flat_map(|c| c.frames.iter().copied()).collect();
        let seen: BTreeSet<usize> = (0..frames.len()).filter(|f| !frames[*f].is_empty()).collect();
        prop_assert_eq!(told, seen, "every frame that showed something is told of");
        let pixels = |c: &Closed<usize, (usize, usize, bool)>| c.best.1;
        let largest = frames.iter().flatten().filter(|o| o.2).map(|o| o.1).max();
        let kept = closed.iter().filter(|c| c.best.2).map(pixels).max();
        prop_assert_eq!(kept, largest, "the best of all whole views is kept");
        prop_assert!(closed.iter().enumerate().all(|(i, c)| c.number == i as u64 + 1));
        for track in &closed {
            prop_assert!(track.frames.contains(&track.best_frame));
            prop_assert!(track.frames.windows(2).all(|w| w[0] < w[1]), "one observation a frame");
        }
    }
}
