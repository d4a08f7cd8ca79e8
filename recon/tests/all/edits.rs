//! Laws of edits.

use crate::common::{cases, random_plant, species};
use demeter_recon::edit::{Change, EditError, Move, Selection, What, bend, between, cut, graft};
use demeter_recon::model::{Form, Plant, PosedPlant, forward};
use proptest::prelude::*;

/// Every organ that hangs on `root`, itself first.
fn subtree(plant: &Plant, root: usize) -> Vec<usize> {
    let mut inside = vec![root];
    for (i, organ) in plant.organs.iter().enumerate().skip(root + 1) {
        inside.extend(organ.parent.filter(|parent| inside.contains(parent)).map(|_| i));
    }
    inside
}

fn close(a: &PosedPlant, b: &PosedPlant, tolerance: f64) -> bool {
    let points = |posed: &PosedPlant| posed.control.concat();
    points(a).iter().zip(&points(b)).all(|(a, b)| a.distance(*b) < tolerance)
}

proptest! {
    #![proptest_config(cases(24))]

    #[test]
    fn the_way_between_two_plants_begins_and_ends_at_them(organs in 1..12_usize, seeds in any::<(u64, u64)>(), t in 0.0..1.0_f64) {
        let species = species("soybean");
        let first = random_plant(&species, organs, seeds.0);
        let mut second = first.clone();
        let other = random_plant(&species, organs, seeds.1);
        second.world_from_plant = other.world_from_plant;
        for (organ, other) in second.organs.iter_mut().zip(&other.organs) {
            organ.joint = other.joint;
            if organ.kind() == other.kind() {
                organ.form = other.form.clone();
            }
        }
        let pose = |plant: &Plant| forward(plant, &species).unwrap();
        prop_assert!(close(&pose(&between(&first, &second, 0.0).unwrap()), &pose(&first), 1e-9));
        prop_assert!(close(&pose(&between(&first, &second, 1.0).unwrap()), &pose(&second), 1e-9));
        // The same place is reached from either end, and between a plant and itself there is only it.
        let way = [between(&first, &second, t).unwrap(), between(&second, &first, 1.0 - t).unwrap()];
        prop_assert!(close(&pose(&way[0]), &pose(&way[1]), 1e-7));
        prop_assert!(close(&pose(&between(&first, &first, t).unwrap()), &pose(&first), 1e-9));
        prop_assert!(between(&first, &second, 1.5).is_err() && between(&first, &second, f64::NAN).is_err());
    }

    #[test]
    fn cutting_takes_a_subtree_and_nothing_else(organs in 2..20_usize, seed in any::<u64>(), at in any::<prop::sample::Index>()) {
        let species = species("maize");
        let plant = random_plant(&species, organs, seed);
        let root = 1 + at.index(organs - 1);
        let gone = subtree(&plant, root);
        let after = cut(&plant, &[root]).unwrap();
        prop_assert_eq!(after.organs.len(), organs - gone.len());
        let (before, posed) = (forward(&plant, &species).unwrap(), forward(&after, &species).unwrap());
        let kept: Vec<_> = (0..organs).filter(|i| !gone.contains(i)).map(|i| before.control[i].clone()).collect();
        prop_assert_eq!(kept, posed.control);
        prop_assert!(cut(&plant, &[0]).is_err());
        prop_assert_eq!(cut(&plant, &[organs]), Err(EditError::NoOrgan { expected: organs, found: organs }));
        prop_assert_eq!(cut(&plant, &[]), Ok(plant));
    }

    #[test]
    fn a_graft_is_the_same_thing_elsewhere(organs in 1..16_usize, seed in any::<u64>(), at in any::<[prop::sample::Index; 2]>(), d in 0.0..1.0_f64) {
        let species = species("tomato");
        let plant = random_plant(&species, organs, seed);
        let from = at[0].index(organs);
        let stems: Vec<usize> = (0..organs).filter(|i| matches!(plant.organs[*i].form, Form::Stem { .. })).collect();
        let onto = stems[at[1].index(stems.len())];
        let copied = subtree(&plant, from);
        let after = graft(&plant, from, onto, d).unwrap();
        prop_assert_eq!(&after.organs[..organs], &plant.organs[..]);
        prop_assert_eq!(after.organs.len(), organs + copied.len());
        let posed = forward(&after, &species).unwrap();
        // The copy is a rigid motion of the original: sizes and distances stay.
        let motion = |i: usize, x| posed.world_from_organ[i].rotation.inverse() * (x - posed.world_from_organ[i].translation);
        for (k, original) in copied.iter().enumerate() {
            for (a, b) in posed.control[*original].iter().zip(&posed.control[organs + k]) {
                let (a, b) = (motion(from, *a), motion(organs, *b));
                prop_assert!(a.distance(b) < 1e-9, "organ {original}: {a} and {b}");
            }
        }
        let used: Vec<u16> = plant.organs.iter().filter_map(leaf).collect();
        prop_assert!(after.organs[organs..].iter().filter_map(leaf).all(|leaf| !used.contains(&leaf)));
        prop_assert!(graft(&plant, from, onto, 1.5).is_err());
    }

    #[test]
    fn bending_once_is_no_bending_and_moves_stay_in_the_model(organs in 1..12_usize, seed in any::<u64>(), by in -9.0..9.0_f64) {
        let species = species("bean");
        let plant = random_plant(&species, organs, seed);
        let pose = |plant: &Plant| forward(plant, &species).unwrap();
        prop_assert!(close(&pose(&bend(&plant, &species, Selection::All, 1.0).unwrap()), &pose(&plant), 1e-9));
        let step = Move { of: Selection::Leaves, what: What::Gamma(0), change: Change::Add(by) };
        match step.apply(&plant, &species) {
            Ok(after) => for (before, after) in plant.organs.iter().zip(&after.organs) {
                match (&before.form, &after.form) {
                    (Form::Leaf { blade: a, .. }, Form::Leaf { blade: b, .. }) => {
                        prop_assert!((a.gamma[0] + by - b.gamma[0]).abs() < 1e-12 && b.gamma[0].abs() <= 3.0 + 1e-9);
                        prop_assert_eq!(&a.gamma[1..], &b.gamma[1..]);
                    }
                    (a, b) => prop_assert_eq!(a, b),
                }
            },
            Err(error) => prop_assert!(matches!(error, EditError::Outside { what: "gamma", index: 0, .. }), "{error}"),
        }
    }
}

fn leaf(organ: &demeter_recon::model::Organ) -> Option<u16> {
    match organ.form {
        Form::Leaf { leaf, .. } => Some(leaf),
        Form::Stem { .. } => None,
    }
}

#[test]
fn straight_stems_are_straight_and_other_edits_name_what_is_wrong() {
    let species = species("soybean");
    let plant = random_plant(&species, 9, 4);
    let straight = bend(&plant, &species, Selection::Stems, 0.0).unwrap();
    for (organ, control) in straight.organs.iter().zip(forward(&straight, &species).unwrap().control) {
        let chord = control[0].distance(control[control.len() - 1]);
        let path: f64 = control.windows(2).map(|p| p[0].distance(p[1])).sum();
        // Straight but for the part of the mean stem's bend that lies outside the basis.
        assert!(matches!(organ.form, Form::Leaf { .. }) || chord > 0.999 * path, "{chord} of {path}");
    }
    let leaf = plant.organs.iter().position(|organ| matches!(organ.form, Form::Leaf { .. })).unwrap();
    let step: Move = format!("{leaf}:radius*=2").parse().unwrap();
    assert_eq!(step.apply(&plant, &species), Err(EditError::NoSuch { organ: leaf, expected: "a stem", found: "leaf" }));
    assert!(matches!(bend(&plant, &species, Selection::Organ(leaf), 2.0), Err(EditError::NoSuch { .. })));
    let mut other = plant.clone();
    other.organs.pop();
    assert!(between(&plant, &other, 0.5).unwrap_err().to_string().contains("number of organs"));
    let mut other = plant.clone();
    other.organs[leaf].form = plant.organs[0].form.clone();
    assert!(
        matches!(between(&plant, &other, 0.5), Err(EditError::Topology { what: "kind", organ, .. }) if organ == leaf)
    );
}

#[test]
fn moves_are_read_as_they_are_written() {
    let of = |text: &str| text.parse::<Move>();
    let step = |of, what, change| Ok(Move { of, what, change });
    assert_eq!(of("leaves:gamma.2+=0.5"), step(Selection::Leaves, What::Gamma(2), Change::Add(0.5)));
    assert_eq!(of("7:beta.0-=1"), step(Selection::Organ(7), What::Beta(0), Change::Add(-1.0)));
    assert_eq!(of("7:d=0.25"), step(Selection::Organ(7), What::D, Change::Set(0.25)));
    assert_eq!(of("stems:gamma.0=-1"), step(Selection::Stems, What::Gamma(0), Change::Set(-1.0)));
    assert_eq!(of("all:scale*=1.5"), step(Selection::All, What::Scale, Change::Times(1.5)));
    for wrong in
        ["", "leaves", "leaves:gamma.2", "leaf:gamma.2=1", "all:gama.1=1", "all:scale*=x", "3:d=inf", "3:beta.x=1"]
    {
        assert!(of(wrong).is_err(), "{wrong}");
    }
}
