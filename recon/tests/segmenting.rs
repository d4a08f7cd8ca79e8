//! Clouds to organs on plants of the synthetic world, whose truth is exact.
#![allow(clippy::unwrap_used)]

use demeter_recon::cloud::{PointCloud, PointOrgan};
use demeter_recon::export::cloud_to_ply;
use demeter_recon::model::{OrganKind, Plant, Species};
use demeter_recon::segment::{Labels, SegmentError, Segmented, Up, segment};
use demeter_recon::species;
use demeter_recon::world::{LabelledCloud, grow, labelled_cloud, seeded};
use glam::{DMat3, DVec3};

/// A grown plant as 6,000 points with half a millimetre of noise.
fn grown(name: &str, age: f64, seed: u64) -> (Species, Plant, LabelledCloud) {
    let species = species::shipped(name).unwrap().unwrap();
    let mut rng = seeded(seed);
    let plant = grow(&species, age, &mut rng);
    let cloud = labelled_cloud(&plant, &species, 6_000, 0.0005, &mut rng).unwrap();
    (species, plant, cloud)
}

/// The same cloud with its organs apart, as `demeter fit --points` writes them.
fn apart(plant: &Plant, made: &LabelledCloud) -> PointCloud {
    let organ = |organ: &u32| PointOrgan { organ: *organ as i32, kind: plant.organs[*organ as usize].kind() };
    PointCloud { organs: Some(made.organ.iter().map(organ).collect()), ..made.cloud.clone() }
}

fn divided(cloud: &PointCloud, species: &Species, labels: Labels, up: Up) -> Segmented {
    segment(cloud, species.habit, labels, up).unwrap()
}

#[test]
fn up_is_found_in_six_poses() {
    let (mut right, mut right_of_labels, mut all) = (0, 0, 0);
    for name in species::NAMES {
        for (age, seed) in [(0.1, 1), (0.3, 2), (0.5, 3)] {
            let (species, _, made) = grown(name, age, seed);
            for up in DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
                let side = if up.x == 0.0 { DVec3::X } else { DVec3::Y };
                let turn = DMat3::from_cols(side, up.cross(side), up);
                let mut cloud = made.cloud.clone();
                cloud.points.iter_mut().for_each(|p| *p = turn * *p + DVec3::new(3.0, -1.0, 2.0));
                all += 1;
                right += usize::from(divided(&cloud, &species, Labels::None, Up::Auto).up == up);
                right_of_labels += usize::from(divided(&cloud, &species, Labels::Own, Up::Auto).up == up);
            }
        }
    }
    eprintln!("up right on {right} of {all} clouds, with labels {right_of_labels}");
    // The youngest grasses are two straps on a stump, alike from every end.
    assert!(right * 20 >= all * 17, "{right} of {all}");
    assert_eq!(right_of_labels, all);
}

#[test]
fn organs_apart_stay_as_they_are() {
    for (name, age) in [("soybean", 0.4), ("maize", 0.5)] {
        let (species, plant, made) = grown(name, age, 7);
        let cloud = PointCloud::from_ply(&cloud_to_ply(&apart(&plant, &made))).unwrap();
        let found = divided(&cloud, &species, Labels::Auto, Up::Axis(DVec3::Z));
        for organ in &found.organs {
            let number = made.organ[organ.source[0] as usize];
            assert_eq!(organ.kind, plant.organs[number as usize].kind());
            let truth: Vec<u32> = (0..).zip(&made.organ).filter(|(_, of)| **of == number).map(|(i, _)| i).collect();
            assert_eq!(organ.source, truth, "{name}: organ {number}");
        }
        // The label alone knows no stems apart, and an organ of two kinds is none.
        let stems = |s: &Segmented| s.organs.iter().filter(|o| o.kind != OrganKind::Leaf).count();
        assert!(stems(&divided(&cloud, &species, Labels::Own, Up::Axis(DVec3::Z))) > 0);
        let mut wrong = cloud.clone();
        wrong.organs.as_mut().unwrap()[0].kind = OrganKind::Stem;
        wrong.organs.as_mut().unwrap()[1] = PointOrgan { kind: OrganKind::Leaf, ..wrong.organs.as_ref().unwrap()[0] };
        let number = wrong.organs.as_ref().unwrap()[0].organ;
        let refused = segment(&wrong, species.habit, Labels::Auto, Up::Axis(DVec3::Z));
        assert_eq!(refused, Err(SegmentError::Kinds { organ: number }));
    }
}
