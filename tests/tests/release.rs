//! The authors' release as an oracle (spec/demeter-model.md "Laws to test"): its plants in this model's kinematics
//! against the vertices that the release itself decodes.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use demeter_recon::cloud::PointCloud;
use demeter_recon::import::release::{Bases, FILES, PLANT_FILES, RawForm, RawPlant, ReleaseForm, ReleasePlant};
use demeter_recon::model::{Shape, Species};
use demeter_tests::{answer, demeter, shared};
use glam::DVec3;

const PLANTS: [&str; 5] = ["3_i", "3_o", "4_o", "6_o", "101_o"];
/// Vertices of the release's leaf, and of its stem: 24 rings of 33.
const LEAF_VERTICES: usize = 45 * 43;
const RING: usize = 33;

fn read(folder: &Path, names: [&str; 3]) -> [Vec<u8>; 3] {
    names.map(|name| std::fs::read(folder.join(name)).unwrap())
}

fn bases(release: &Path) -> Bases {
    let [shape, leaf, stem] = read(release, FILES);
    Bases::read([&shape, &leaf, &stem]).unwrap()
}

fn plant(release: &Path, name: &str) -> ReleasePlant {
    let [classes, parents, graph] = read(&release.join(name), PLANT_FILES);
    ReleasePlant::read([&classes, &parents, &graph]).unwrap()
}

#[test]
fn stored_points_come_back_from_their_joint_angles() {
    let test = "stored_points_come_back_from_their_joint_angles";
    let Some(release) = shared(test, "data/demeter-release/soybean") else { return };
    let bases = bases(&release);
    for name in PLANTS {
        for organ in plant(&release, name).organs {
            let (form, world) = match &organ.form {
                ReleaseForm::Leaf(beta) => RawForm::leaf(&bases.flat(beta), &organ.points, 1.0),
                ReleaseForm::Stem(radius) => RawForm::stem(&organ.points, *radius),
            };
            let points = match form.shape() {
                Shape::Stem(curve, _) => curve.points,
                Shape::Blade(points) => points,
            };
            let apart: f64 = points.iter().zip(&organ.points).map(|(p, q)| world.point(*p).distance(*q)).sum();
            let mean = apart / points.len() as f64 / world.scale;
            // 2.6e-7 is what f32 leaves; the law asks for 1e-5.
            assert!(mean < 1e-6, "{name} node {}: {mean} of its length", organ.node);
        }
    }
}

#[test]
fn plants_stand_where_the_release_decodes_them() {
    let test = "plants_stand_where_the_release_decodes_them";
    let Some(release) = shared(test, "data/demeter-release/soybean") else { return };
    let bases = bases(&release);
    for name in PLANTS {
        let plant = plant(&release, name);
        let posed = RawPlant::of(&plant, &bases).pose().unwrap();
        let truth = PointCloud::from_ply(&std::fs::read(release.join(name).join("decoded-vertices.ply")).unwrap());
        let truth = truth.unwrap().points;
        let (low, high) = truth.iter().fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
        let diagonal = low.distance(high);
        let (mut rest, mut sum) = (truth.as_slice(), 0.0);
        for (i, organ) in plant.organs.iter().enumerate() {
            let control = &posed.control[i];
            let (mine, others) = match organ.form {
                ReleaseForm::Leaf(_) => rest.split_at(LEAF_VERTICES),
                ReleaseForm::Stem(_) => rest.split_at(control.len() * RING),
            };
            let apart = |(k, p): (usize, &DVec3)| match organ.form {
                ReleaseForm::Leaf(_) => control.iter().map(|q| q.distance(*p)).fold(f64::MAX, f64::min),
                ReleaseForm::Stem(_) => (control[k / RING].distance(*p) - posed.radius[i]).abs(),
            };
            let own: f64 = mine.iter().enumerate().map(apart).sum();
            // Each organ by itself, so that no small one hides among large ones; measured: at most 4e-5.
            let mean = own / mine.len() as f64 / diagonal;
            assert!(mean < 1e-4, "{name} node {}: {mean} of the diagonal", organ.node);
            (rest, sum) = (others, sum + own);
        }
        assert!(rest.is_empty(), "{name}: vertices of no organ");
        let mean = sum / truth.len() as f64 / diagonal;
        assert!(mean < 1e-5, "{name}: {mean} of the diagonal");
    }
}

#[test]
fn the_commands_make_a_species_and_a_record_of_the_release() {
    let test = "the_commands_make_a_species_and_a_record_of_the_release";
    let Some(release) = shared(test, "data/demeter-release/soybean") else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, record, mesh) = (at("release.safetensors"), at("plant.dmtr"), at("plant.ply"));
    let made = demeter().args(["species", "import", "--release", release.to_str().unwrap(), "-o", &file]).output();
    assert_eq!(made.unwrap().status.code(), Some(0));
    let species = Species::from_bytes(&std::fs::read(&file).unwrap()).unwrap();
    assert!(species.provenance.contains("non-commercial"), "{}", species.provenance);
    let ranks = [species.leaf.shape.rank(), species.leaf.deform.rank(), species.stem.deform.rank()];
    assert_eq!(ranks, [10, 18, 14]);
    let plant = release.join("3_i");
    let arguments = ["import", plant.to_str().unwrap(), "--species", &file, "-o", &record, "--mesh", &mesh];
    let (code, imported) = answer(&arguments);
    assert_eq!(code, Some(0), "{imported}");
    assert_eq!(imported["plants"][0]["traits"]["blade_count"]["value"], 8.0);
    assert!(std::fs::metadata(&mesh).unwrap().len() > 1000);
    // The record needs its species file, and says so.
    let (code, refused) = answer(&["decode", &record]);
    let message = refused["error"]["message"].as_str().unwrap();
    assert!(code == Some(1) && message.contains("soybean-release") && message.contains("--species"), "{message}");
    let (code, decoded) = answer(&["decode", &record, "--species", &file]);
    assert_eq!((code, &decoded["plants"][0]["traits"]), (Some(0), &imported["plants"][0]["traits"]));
    let (code, refused) = answer(&["decode", &record, "--species", "soybean"]);
    assert!(
        code == Some(1) && refused["error"]["expected"].as_str().unwrap().starts_with("soybean-release"),
        "{refused}"
    );
}
