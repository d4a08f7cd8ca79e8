//! Lifting on the renderer's pictures with their own truth in the place of the network's maps.

use demeter_frame::{Depth, Intrinsics, Mask, Pinhole, Pose};
use demeter_recon::metrics::sample_surface;
use demeter_recon::model::{Detail, Knots, OrganKind, PlantMesh, forward};
use demeter_recon::nearest::Nearest;
use demeter_recon::organs::ScaleSource;
use demeter_recon::species::shipped;
use demeter_recon::view::{self, PlantView, View};
use demeter_recon::world::{self, Row, Scene, Sensor, boundary_distance, render, row, seeded};
use image::{GrayImage, Luma};

/// A picture of a row with its truth, and the maps that a perfect network would make of it.
struct Shot {
    scene: Scene,
    seen: world::View,
    dist: Mask,
    log_depth: Depth,
    intrinsics: Intrinsics,
    pose: Pose,
}

fn shots(species: &str, seed: u64) -> Vec<Shot> {
    let species = shipped(species).unwrap().unwrap();
    let intrinsics = Intrinsics::from_hfov(640, 480, 1.1);
    let plan = Row { plants: 4, spacing: 0.45, age: 0.5, frames: 5 };
    (0..5)
        .map(|frame| {
            let (scene, poses) = row(&species, &plan, &intrinsics, seed).unwrap();
            let pose = poses[frame];
            let camera = Pinhole { intrinsics, world_from_camera: pose };
            let seen = render(&scene, &camera, &Sensor::CLEAN, &mut seeded(seed));
            // The network's log depth has a constant of its own; -1.3 stands for it.
            let log_depth = Depth::from_fn(640, 480, |x, y| Luma([seen.depth.get_pixel(x, y).0[0].ln() - 1.3]));
            let dist = boundary_distance(&seen.instances);
            Shot { scene, dist, log_depth, intrinsics, pose, seen }
        })
        .collect()
}

impl Shot {
    fn view(&self) -> View<'_> {
        View {
            semantic: &self.seen.semantic,
            dist: &self.dist,
            log_depth: &self.log_depth,
            intrinsics: self.intrinsics,
            world_from_camera: Some(self.pose),
        }
        .validated()
        .unwrap()
    }

    /// Kind and pixels of each visible instance of at least `least` pixels.
    fn truth(&self, least: usize) -> Vec<(u16, u8, usize)> {
        let mut sizes = vec![(0u8, 0usize); self.seen.organs.len() + 1];
        for (id, class) in self.seen.instances.pixels().zip(self.seen.semantic.pixels()) {
            let size = &mut sizes[usize::from(id.0[0])];
            *size = (class.0[0], size.1 + 1);
        }
        let each = sizes.into_iter().enumerate().skip(1).filter(|(_, (_, n))| *n >= least);
        each.map(|(id, (class, n))| (id as u16, class, n)).collect()
    }
}

/// Matched at IoU >= 0.5 (reconstruction.md "Metrics"): true instances, found ones, matches.
fn matches(shot: &Shot) -> (usize, usize, usize) {
    let view = shot.view();
    let (raster, regions) = view::instances(&view);
    let truth = shot.truth(view.pixels(100.0));
    let big: Vec<_> = regions.iter().filter(|r| r.pixels >= view.pixels(100.0)).collect();
    let mut common = std::collections::BTreeMap::new();
    for (found, real) in raster.pixels().zip(shot.seen.instances.pixels()) {
        *common.entry((found.0[0], real.0[0])).or_insert(0usize) += 1;
    }
    let matched = truth.iter().filter(|(id, _, size)| {
        regions.iter().any(|region| {
            let both = common.get(&(region.id, *id)).copied().unwrap_or(0);
            2 * both >= size + region.pixels - both
        })
    });
    (truth.len(), big.len(), matched.count())
}

fn plants(shot: &Shot) -> Vec<PlantView> {
    let view = shot.view();
    let (raster, regions) = view::instances(&view);
    let scale = view::ground_plane(&view).unwrap();
    assert_eq!(scale.source, ScaleSource::GroundPlane);
    assert!((scale.factor.ln() - 1.3).abs() < 0.01, "{scale:?}");
    let lifted = view::lift(&view, &raster, &regions, scale);
    view::group(&view, &lifted.organs).0
}

#[test]
fn instances_of_true_maps_match_the_true_organs() {
    for species in ["soybean", "maize"] {
        let (mut truth, mut found, mut matched) = (0, 0, 0);
        for shot in (0..3).flat_map(|seed| shots(species, seed)) {
            let (t, f, m) = matches(&shot);
            (truth, found, matched) = (truth + t, found + f, matched + m);
        }
        let (recall, precision) = (matched as f64 / truth as f64, matched as f64 / found as f64);
        // Blades that cross a stem or fold over are found in parts.
        assert!(recall > 0.8 && precision > 0.75, "{species}: recall {recall:.3}, precision {precision:.3}");
    }
}

#[test]
fn lifted_points_lie_on_the_true_plants_and_plants_stand_where_they_stand() {
    for species_name in ["soybean", "maize"] {
        let species = shipped(species_name).unwrap().unwrap();
        let mut offs: Vec<f64> = Vec::new();
        for shot in shots(species_name, 7) {
            let mut surface = Vec::new();
            for standing in &shot.scene.plants {
                let mesh = PlantMesh::of(&forward(&standing.plant, &species).unwrap(), Detail::Coarse, Knots::Uniform);
                surface.extend(sample_surface(&mesh, 20_000, 0).into_iter().map(|(p, _)| p));
            }
            let surface = Nearest::of(&surface);
            let found = plants(&shot);
            let mut distances: Vec<f64> = found
                .iter()
                .flat_map(|plant| plant.organs.iter().filter(|_| !plant.stand_in))
                .flat_map(|organ| &organ.points)
                .map(|p| surface.one(*p).unwrap().distance())
                .collect();
            distances.sort_by(f64::total_cmp);
            let at = |share: f64| distances[(distances.len() as f64 * share) as usize];
            // Surface samples are about 3 mm apart; 1 % of a 1 m depth is 10 mm.
            assert!(at(0.5) < 0.004 && at(0.99) < 0.02, "{species_name}: median {}, 99 % {}", at(0.5), at(0.99));
            let view = shot.view();
            for plant in found.iter().filter(|p| !p.touches_border && !p.stand_in && p.pixels > 2000) {
                let at = plant.ground_position(&view);
                let nearest = shot
                    .scene
                    .plants
                    .iter()
                    .map(|s| s.plant.world_from_plant.translation.truncate().distance(at))
                    .fold(f64::INFINITY, f64::min);
                offs.push(nearest);
                assert_eq!(plant.organs[0].kind, OrganKind::MainStem);
            }
        }
        offs.sort_by(f64::total_cmp);
        assert!(offs[offs.len() / 2] < 0.03 && offs[offs.len() * 8 / 10] < 0.1, "{species_name}: {offs:?}");
    }
}

#[test]
fn a_blind_network_shows_no_plant() {
    let shot = &shots("soybean", 1)[2];
    let nothing = GrayImage::new(640, 480);
    let view = View { semantic: &nothing, ..shot.view() };
    assert_eq!(view::instances(&view).1, []);
}
