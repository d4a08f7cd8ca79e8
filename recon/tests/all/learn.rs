//! Learning from clouds: what a grown plant's points teach are the bends it was grown with, and a basis that learned
//! them explains plants that it has not seen.

use demeter_recon::learn::{Components, Lesson, LessonError, Taught, adapted, reach, rich, rich_in_shape};
use demeter_recon::model::{Form, Priors, Species};
use demeter_recon::segment::{Labels, Up, segment};
use demeter_recon::species::generic;
use demeter_recon::world::{grow, labelled_cloud, seeded};
use glam::DVec3;

/// The lesson of a grown plant and how many blades it has.
fn lesson(grown_from: &Species, rich: &Species, seed: u64) -> (Lesson, usize) {
    let mut random = seeded(seed);
    let plant = grow(grown_from, 0.3, &mut random);
    let cloud = labelled_cloud(&plant, grown_from, 12_000, 0.0, &mut random).unwrap().cloud;
    let organs = segment(&cloud, rich, Labels::Own, Up::Axis(DVec3::Z)).unwrap().organs;
    let blades = plant.organs.iter().filter(|o| matches!(o.form, Form::Leaf { .. })).count();
    (Lesson::of_plant(organs, DVec3::Z, rich).unwrap(), blades)
}

#[test]
fn grown_plants_teach_their_bends() {
    let from = generic("maize").unwrap().unwrap();
    let rich = rich(&from, &[]).unwrap();
    let (lessons, blades): (Vec<Lesson>, Vec<usize>) = (0..4).map(|seed| lesson(&from, &rich, seed)).unzip();
    let (taught, grown): (usize, usize) = (lessons.iter().map(|l| l.leaves.len()).sum(), blades.iter().sum());
    assert!(taught * 10 >= grown * 8, "{taught} of {grown} blades");
    let reached = reach(&lessons, &from, &[1, 12]).unwrap();
    // Of a blade's length; the released bases of the paper miss by 0.026 to 0.032 with 18 components.
    assert!(reached[1].leaf < 0.01 && reached[1].leaf < 0.3 * reached[0].leaf, "{reached:?}");

    let species = Taught::new(&lessons, &from, Components { leaf: 12, stem: 8 }).unwrap();
    let species = species.species(&from, "grown".into()).unwrap();
    assert_eq!((species.leaf.deform.rank(), species.stem.deform.rank()), (12, 8));
    assert_eq!(Species::from_bytes(&species.to_bytes().unwrap()).unwrap(), species);
    // The world's maize leaves its stalk at 10 to 60 degrees and arches over, so its chords stand out more.
    let inclination = species.priors.blade.inclination;
    assert!((0.3..2.0).contains(&inclination.mean) && inclination.sd < 1.0, "{inclination:?}");
    assert_eq!(species.priors.stem, Priors::UNKNOWN.stem);
}

#[test]
fn adapting_moves_a_relative_towards_what_it_sees() {
    let from = generic("soybean").unwrap().unwrap();
    let rich = rich_in_shape(&from).unwrap();
    // Tomato's generic blades are narrower than soybean's: 0.26 against 0.31 lengths.
    let narrow = generic("tomato").unwrap().unwrap();
    let width = |species: &Species| species.leaf.shape.mean().iter().step_by(2).map(|x| x.abs()).sum::<f64>();
    let (lesson, _) = lesson(&narrow, &rich, 5);
    let adapted = adapted(&[lesson], &from).unwrap().species(&from, "adapted".into()).unwrap();
    assert!(width(&adapted) < 0.98 * width(&from), "{} of {}", width(&adapted), width(&from));
    assert!(width(&adapted) > 0.9 * width(&narrow), "{} of {}", width(&adapted), width(&narrow));
}

#[test]
fn clouds_that_are_no_organs_are_refused_with_a_reason() {
    let rich = rich(&generic("soybean").unwrap().unwrap(), &[]).unwrap();
    for nothing in [&[][..], &[DVec3::ONE; 200], &[DVec3::NAN; 200]] {
        assert_eq!(Lesson::of_leaf(nothing, DVec3::Z, &rich), Err(LessonError::Extent));
    }
    let few: Vec<DVec3> = (0..20).map(|i| DVec3::new(f64::from(i), f64::from(i % 3), 0.0)).collect();
    let lesson = Lesson::of_leaf(&few, DVec3::Z, &rich).unwrap();
    assert_eq!((lesson.leaves.len(), lesson.refused.len()), (0, 1), "{:?}", lesson.refused);
    assert!(Lesson::of_plant(Vec::new(), DVec3::Z, &rich).is_err());
}
