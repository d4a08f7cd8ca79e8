use nalgebra::DVector;
use proptest::prelude::*;

use super::*;
use crate::model::PosedPlant;
use crate::model::stem::BONES;
use crate::world::{grow, labelled_cloud, seeded};

fn soybean() -> Species {
    crate::species::generic("soybean").expect("listed").expect("valid")
}

/// A grown plant with the points of each of its organs.
fn grown(species: &Species, seed: u64) -> (Plant, Vec<Vec<DVec3>>) {
    let plant = grow(species, 0.2, &mut seeded(seed));
    let cloud = labelled_cloud(&plant, species, 8_000, 0.0, &mut seeded(seed + 1)).expect("valid");
    let mut points = vec![Vec::new(); plant.organs.len()];
    for (p, organ) in cloud.cloud.points.iter().zip(&cloud.organ) {
        points[*organ as usize].push(*p);
    }
    (plant, points)
}

/// The plant with every joint turned, moved and scaled a little, stems bent and thickened.
fn disturbed(plant: &Plant) -> Plant {
    let mut plant = plant.clone();
    for (i, organ) in plant.organs.iter_mut().enumerate() {
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        let turn = DQuat::from_scaled_axis(DVec3::new(0.03, -0.02 * sign, 0.04) * sign);
        organ.joint.rotation = relative(DQuat::IDENTITY, organ.joint.rotation * turn);
        organ.joint.d = (organ.joint.d - 0.01 * sign).clamp(0.0, 1.0);
        if let Form::Stem { gamma, radius } = &mut organ.form {
            gamma[0] += 0.1 * sign;
            *radius *= 1.2;
            organ.joint.scale *= 1.0 + 0.02 * sign;
        }
    }
    plant
}

fn evidence(points: &[Vec<DVec3>]) -> Vec<Evidence<'_>> {
    points.iter().map(|points| Evidence { points, radius_known: true }).collect()
}

fn moved(plant: &Plant, members: &[Member], steps: &[DVector<f64>], species: &Species) -> PosedPlant {
    let mut plant = plant.clone();
    put_back(&mut plant, &stepped(members, steps, species), species);
    forward(&plant, species).expect("valid")
}

/// Mean distance between the control points of two poses, metres.
fn distance(a: &PosedPlant, b: &PosedPlant) -> f64 {
    let pairs = a.control.iter().flatten().zip(b.control.iter().flatten());
    mean(pairs.map(|(p, q)| p.distance(*q))).unwrap()
}

#[test]
fn a_disturbed_plant_finds_back_and_the_cost_never_rises() {
    let species = soybean();
    let (truth, points) = grown(&species, 1);
    let start = disturbed(&truth);
    let evidence = evidence(&points);
    let mut plant = start.clone();
    refine(&mut plant, &evidence, &species).expect("valid");
    plant.validate().expect("valid");
    let posed = [&truth, &start, &plant].map(|plant| forward(plant, &species).expect("valid"));
    let [before, after] = [&posed[1], &posed[2]].map(|pose| distance(pose, &posed[0]));
    assert!(after < 0.5 * before, "{before} m off before, {after} m after");
    // Costs in the same terms: those of the points and spreads of the start.
    let at_start = members(&start, &species).expect("valid");
    let organs = start.organs.iter().zip(&evidence).zip(&at_start);
    let data: Vec<Data> = organs.map(|((o, e), m)| Data::of(&o.form, *e, m, &species)).collect();
    let cost = |plant: &Plant| equations(&members(plant, &species).expect("valid"), &data, &species).cost;
    assert!(cost(&plant) < cost(&start), "{} {}", cost(&start), cost(&plant));
}

#[test]
fn turning_and_moving_the_cloud_turns_and_moves_the_plant() {
    let species = soybean();
    let (truth, points) = grown(&species, 3);
    let mut here = disturbed(&truth);
    let mut there = here.clone();
    let (turn, shift) = (DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7)), DVec3::new(3.0, -1.0, 0.5));
    there.world_from_plant = demeter_frame::Pose::new(turn, shift).then(&here.world_from_plant);
    let turned: Vec<Vec<DVec3>> =
        points.iter().map(|points| points.iter().map(|p| turn * *p + shift).collect()).collect();
    refine(&mut here, &evidence(&points), &species).expect("valid");
    refine(&mut there, &evidence(&turned), &species).expect("valid");
    let [here, there] = [here, there].map(|plant| forward(&plant, &species).expect("valid"));
    for (p, q) in here.control.iter().flatten().zip(there.control.iter().flatten()) {
        assert!((turn * *p + shift).distance(*q) < 1e-4, "{p} became {q}");
    }
}

#[test]
fn a_bridge_follows_what_hangs_on_it() {
    let species = soybean();
    let (truth, mut points) = grown(&species, 5);
    let bridge = truth.organs.iter().rposition(|o| matches!(o.form, Form::Stem { .. })).expect("petioles");
    points[bridge].clear();
    let mut plant = disturbed(&truth);
    let before = distance(&forward(&plant, &species).expect("valid"), &forward(&truth, &species).expect("valid"));
    let outcomes = refine(&mut plant, &evidence(&points), &species).expect("valid");
    let after = distance(&forward(&plant, &species).expect("valid"), &forward(&truth, &species).expect("valid"));
    assert!(
        outcomes[bridge].residual.is_none() && outcomes[bridge].sigmas.is_empty() && after < 0.5 * before,
        "{before} {after}"
    );
}

#[test]
fn noisier_points_are_less_sure() {
    use crate::traits::keys::{INTERNODE_LENGTH, STEM_DIAMETER, STEM_LENGTH};
    let species = soybean();
    let (truth, points) = grown(&species, 7);
    let sigma = |points: &[Vec<DVec3>], organ: usize, key| {
        let outcomes = refine(&mut truth.clone(), &evidence(points), &species).expect("valid");
        outcomes[organ].sigmas[key].data
    };
    // Noise of 1 mm, the same number of points: it looks like none to the fit.
    let noisy: Vec<Vec<DVec3>> = points
        .iter()
        .map(|organ| {
            organ
                .iter()
                .map(|p| *p + 0.001 * DVec3::new((p.x * 9e5).sin(), (p.y * 9e5).sin(), (p.z * 9e5).sin()))
                .collect()
        })
        .collect();
    for (organ, key) in [(0, STEM_LENGTH), (0, STEM_DIAMETER), (1, INTERNODE_LENGTH)] {
        let (clean, noisy) = (sigma(&points, organ, key), sigma(&noisy, organ, key));
        assert!(clean > 0.0 && noisy > clean, "{key}: {clean} clean, {noisy} with noise");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// The linear motion of every stem's control points, through all joints above it, against central differences
    /// through forward kinematics.
    #[test]
    fn motions_are_those_of_forward_kinematics(seed in 0..1_000_u64) {
        let species = soybean();
        let (truth, points) = grown(&species, seed);
        let members = members(&truth, &species).expect("valid");
        let organs = truth.organs.iter().zip(evidence(&points)).zip(&members);
        let data: Vec<Data> = organs.map(|((o, e), m)| Data::of(&o.form, e, m, &species)).collect();
        let equations = equations(&members, &data, &species);
        const EPSILON: f64 = 1e-6;
        let mut random = seeded(seed);
        let mut steps: Vec<DVector<f64>> = Vec::new();
        for (block, member) in equations.blocks.iter().zip(&members) {
            let mut step = DVector::from_fn(block.g.len(), |_, _| rand::Rng::random_range(&mut random, -1.0..1.0));
            if let Some(parent) = block.parent {
                let place = &block.carry * &steps[parent];
                step.rows_mut(0, elimination::PLACE).copy_from(&place);
                // A joint at an end of its parent cannot move beyond it.
                if !(0.01..0.99).contains(&member.d) {
                    step[elimination::D] = 0.0;
                }
            } else {
                step[elimination::D] = 0.0;
            }
            steps.push(step);
        }
        let at = |sign: f64| {
            let steps: Vec<DVector<f64>> = steps.iter().map(|step| step * (sign * EPSILON)).collect();
            moved(&truth, &members, &steps, &species)
        };
        let (ahead, behind) = (at(1.0), at(-1.0));
        let mut tangents = Vec::new();
        for (i, (block, member)) in equations.blocks.iter().zip(&members).enumerate() {
            let tangent = match block.parent.map(|p| (&members[p].body, p)) {
                Some((Body::Tube(tube), parent)) => carried(&mut Rows::of(tube, &species), tangents[parent], member.d).tangent,
                _ => DVec3::ZERO,
            };
            tangents.push(tangent);
            let Body::Tube(tube) = &member.body else { continue };
            let mut rows = Rows::of(tube, &species);
            let (own, base) = (&steps[i], DVec3::from_slice(steps[i].as_slice()) + tangent * steps[i][elimination::D]);
            for bone in 0..BONES {
                let found = (ahead.control[i][bone + 1] - behind.control[i][bone + 1]) / (2.0 * EPSILON);
                for axis in 0..3 {
                    let gradient = rows.gradient(bone, 1.0, DVec3::AXES[axis]);
                    let rest: f64 = gradient[3..].iter().zip(&own.as_slice()[elimination::TURN..]).map(|(g, s)| g * s).sum();
                    let expected = base[axis] + rest;
                    prop_assert!((found[axis] - expected).abs() < 1e-4 * (1.0 + expected.abs()), "organ {i} bone {bone}: {found} {expected}");
                }
            }
        }
    }
}
