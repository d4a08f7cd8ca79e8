//! Clouds to organs by what a network says, on plants whose truth is exact: what a perfect network would say, and what a
//! broken one might.

use demeter_frame::PointMaps;
use demeter_recon::cloud::{PointOrgan, diagonal};
use demeter_recon::metrics::{Division, stems_merged};
use demeter_recon::model::{OrganKind, Species};
use demeter_recon::segment::{SegmentError, Segmented, Up, segment_predicted};
use demeter_recon::species;
use demeter_recon::world::{grow, labelled_cloud, seeded};
use glam::DVec3;

/// A grown plant of 4,000 points with half a millimetre of noise, and the truth of each.
fn grown(name: &str, age: f64) -> (Species, Vec<DVec3>, Vec<PointOrgan>) {
    let species = species::generic(name).unwrap().unwrap();
    let mut rng = seeded(11);
    let plant = grow(&species, age, &mut rng);
    let made = labelled_cloud(&plant, &species, 4_000, 0.0005, &mut rng).unwrap();
    let organ = |organ: &u32| PointOrgan { organ: *organ as i32, kind: plant.organs[*organ as usize].kind() };
    (species, made.cloud.points, made.organ.iter().map(organ).collect())
}

/// What a perfect network says.
fn perfect(points: &[DVec3], truth: &[PointOrgan]) -> PointMaps {
    let delta = 0.01 * diagonal(points).unwrap();
    let distance = |i: usize| {
        let others = (0..points.len()).filter(|j| truth[*j].organ != truth[i].organ);
        others.map(|j| points[i].distance(points[j])).fold(f64::INFINITY, f64::min)
    };
    let probabilities = truth.iter().map(|point| match point.kind {
        OrganKind::Leaf => [0.9, 0.05, 0.05],
        OrganKind::Stem => [0.05, 0.9, 0.05],
        OrganKind::MainStem => [0.05, 0.05, 0.9],
    });
    PointMaps {
        probabilities: probabilities.collect(),
        boundary: (0..points.len()).map(|i| (delta / distance(i).max(delta)) as f32).collect(),
    }
}

fn divided(points: &[DVec3], maps: &PointMaps, species: &Species) -> Segmented {
    segment_predicted(points, maps, species, Up::Axis(DVec3::Z)).unwrap()
}

#[test]
fn a_perfect_network_finds_the_organs() {
    for (name, age) in [("soybean", 0.3), ("tobacco", 0.5), ("maize", 0.5)] {
        let (species, points, truth) = grown(name, age);
        let maps = perfect(&points, &truth);
        let found = divided(&points, &maps, &species);
        assert_eq!(found, divided(&points, &maps, &species), "twice the same");
        let found = found.of_points(points.len());
        let merged = Division::of(&stems_merged(&found), &stems_merged(&truth));
        let shares = [merged.precision(), merged.recall(), merged.semantic_iou()].map(Option::unwrap);
        let stems = Division::of(&found, &truth).right_stems().unwrap();
        eprintln!("{name}: precision, recall, IoU {shares:.3?}, right stems {stems:.3}");
        assert!(shares.iter().all(|share| *share > 0.8), "{name}: {shares:?}");
        assert!(stems > 0.8, "{name}: {stems}");
    }
}

#[test]
fn a_broken_network_costs_organs_and_nothing_else() {
    for name in ["soybean", "maize"] {
        let (species, points, truth) = grown(name, 0.3);
        let n = points.len();
        let odd = [0.0, 1.0, -3.0, f32::NAN, f32::INFINITY, f32::MIN_POSITIVE];
        for (k, value) in odd.into_iter().enumerate() {
            let maps = PointMaps { probabilities: vec![[value, odd[5 - k], 0.0]; n], boundary: vec![value; n] };
            let found = divided(&points, &maps, &species);
            assert_eq!(found.organs[0].kind, OrganKind::MainStem);
            assert!(found.organs.iter().all(|organ| !organ.points.is_empty()), "{name}, {value}");
            let given: usize = found.organs.iter().map(|organ| organ.source.len()).sum();
            assert!(given <= n, "no point may be in two organs");
        }
        let short = PointMaps { boundary: vec![0.5; n - 1], ..perfect(&points, &truth) };
        let refused = segment_predicted(&points, &short, &species, Up::Axis(DVec3::Z));
        assert_eq!(refused, Err(SegmentError::Maps { expected: n, found: n - 1 }));
    }
}
