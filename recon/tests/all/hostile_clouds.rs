//! No cloud makes segmentation, tree or fit panic, hang or give a number that is not finite: a typed reason or a
//! plant inside the model (spec/reliability.md 28).

use demeter_recon::cloud::PointCloud;
use demeter_recon::model::{Detail, Form, Knots, Plant, PlantMesh, Species, forward};
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::{fit, species, tree};
use glam::DVec3;
use proptest::prelude::*;

/// The whole geometric line; `None` for a typed reason.
fn plant_of(cloud: &PointCloud, species: &Species, up: Up) -> Option<Plant> {
    let segmented = segment(cloud, species, Labels::Auto, up).ok()?;
    let given: usize = segmented.organs.iter().map(|o| o.points.len()).sum();
    assert!(given <= cloud.points.len(), "no point may be in two organs");
    let tree = tree::build(segmented.organs).ok()?;
    Some(fit::plant(&tree, species, segmented.up).ok()?.plant)
}

fn assert_inside_model(plant: &Plant, species: &Species) {
    plant.validate().unwrap();
    for organ in &plant.organs {
        let coefficients: Vec<f64> = match &organ.form {
            Form::Stem { gamma, .. } => gamma.clone(),
            Form::Leaf { blade, .. } => blade.beta.iter().chain(&blade.gamma).copied().collect(),
        };
        assert!(coefficients.iter().all(|c| c.abs() <= 3.0), "{coefficients:?}");
    }
    let mesh = PlantMesh::of(&forward(plant, species).unwrap(), Detail::Control, Knots::Uniform);
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
}

/// Points on a coarse lattice (many coincide), on a line, on a plane, or anywhere, some of them absurd.
fn cloud() -> impl Strategy<Value = PointCloud> {
    let point = prop_oneof![
        3 => (0..6_i32, 0..6_i32, 0..9_i32).prop_map(|(x, y, z)| DVec3::new(x.into(), y.into(), z.into()) * 0.02),
        3 => (0.0..1.0_f64).prop_map(|t| DVec3::new(0.3, -0.2, 1.0) * t),
        3 => (0.0..0.3_f64, 0.0..0.2_f64).prop_map(|(x, y)| DVec3::new(x, y, 0.5)),
        3 => (-0.5..0.5_f64, -0.5..0.5_f64, 0.0..1.0_f64).prop_map(|(x, y, z)| DVec3::new(x, y, z)),
    ];
    let points = prop::collection::vec(point, 0..250);
    (points, prop::option::of(prop::collection::vec(-1..5_i32, 250)), 0..40_u8, 0..250_usize).prop_map(
        |(mut points, labels, absurd, at)| {
            if let Some(p) = points.get_mut(at) {
                match absurd {
                    0 => p.x = f64::NAN,
                    1 => p.y = f64::INFINITY,
                    2 => p.z = 1e300,
                    3 => *p *= 1e6,
                    _ => {}
                }
            }
            PointCloud { labels: labels.map(|l| l[..points.len()].to_vec()), points, ..PointCloud::default() }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn any_cloud_gives_a_reason_or_a_plant_inside_the_model(cloud in cloud(), grass in any::<bool>(), auto in any::<bool>()) {
        let species = species::shipped(if grass { "maize" } else { "soybean" }).unwrap().unwrap();
        let up = if auto { Up::Auto } else { Up::Axis(DVec3::Z) };
        if let Some(plant) = plant_of(&cloud, &species, up) {
            assert_inside_model(&plant, &species);
            // The same cloud gives the same plant, bit for bit.
            prop_assert_eq!(Some(plant), plant_of(&cloud, &species, up));
        }
    }
}

#[test]
fn a_stalk_with_two_sheets_is_a_plant_with_two_blades() {
    let species = species::shipped("tobacco").unwrap().unwrap();
    let mut cloud = PointCloud::default();
    let mut labels = Vec::new();
    for i in 0..400 {
        let (t, turn) = (f64::from(i) / 400.0, f64::from(i) * 2.4);
        cloud.points.push(DVec3::new(0.003 * turn.cos(), 0.003 * turn.sin(), 0.2 * t));
        labels.push(0);
    }
    for (label, side) in [(1, 1.0), (2, -1.0)] {
        for (i, j) in (0..30).flat_map(|i| (0..20).map(move |j| (i, j))) {
            let (v, u) = (f64::from(i) / 29.0, f64::from(j) / 19.0 - 0.5);
            let half = 0.06 * (v * (1.0 - v)).sqrt();
            cloud.points.push(DVec3::new(side * (0.004 + 0.12 * v), 2.0 * u * half, 0.19));
            labels.push(label);
        }
    }
    cloud.labels = Some(labels);
    let plant = plant_of(&cloud, &species, Up::Auto).unwrap();
    assert_inside_model(&plant, &species);
    let blades = plant.organs.iter().filter(|o| matches!(o.form, Form::Leaf { .. })).count();
    assert_eq!(blades, 2);
    assert!((plant.organs[0].joint.scale - 0.2).abs() < 0.01, "stem {}", plant.organs[0].joint.scale);
    // Without points there is no plant: the negative control.
    assert_eq!(plant_of(&PointCloud::default(), &species, Up::Auto), None);
}
