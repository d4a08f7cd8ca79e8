//! Pictures to train on: everything that may vary does.

use demeter_frame::{Intrinsics, Pinhole, Pose, Rgb};
use glam::{DVec3, Vec2, Vec3};
use rand::Rng;

use super::nursery::Wanted;
use super::scene::{Scene, WorldError};
use super::weather::direction;
use super::{Flare, Nursery, Seeded, Sensor, View, plot, portrait, render, seeded};

/// A scene, the camera before it, and the mean brightness that its exposure aims at.
pub(super) struct Shot {
    pub scene: Scene,
    pub camera: Pinhole,
    pub exposure: f32,
}

/// A random picture of `size` x `size` pixels with its truth and its camera. Of every hundred about 28 are single grasses
/// in pots and 14 other potted plants, 36 look along or over a field's rows, 22 at plants outdoors from near. Every plant
/// is a plant in the truth, weeds too. Three of a hundred are black and white silhouettes.
///
/// # Errors
/// [`WorldError`], which valid species rule out.
pub fn training_view(nursery: &Nursery, size: u32, seed: u64) -> Result<(View, Pinhole), WorldError> {
    let mut rng = seeded(seed);
    let kind = rng.random_range(0..100);
    let Shot { scene, camera, exposure } = match kind {
        0..28 => portrait::potted(nursery, Wanted::Grass, size, &mut rng)?,
        28..42 => portrait::potted(nursery, Wanted::Broad, size, &mut rng)?,
        42..78 => plot::rows(nursery, size, &mut rng)?,
        _ => plot::close(nursery, size, &mut rng)?,
    };
    // Small plants of far rows vanish in the blur that a leaf from near bears.
    let sensor = sensor(exposure, if (42..78).contains(&kind) { 0.5 } else { 1.0 }, size, &mut rng);
    let mut view = render(&scene, &camera, &sensor, &mut rng);
    // Masks of single plants are pictures too: other programs' silhouettes are measured as photos are.
    if rng.random_bool(if kind < 28 { 0.08 } else { 0.01 }) {
        view.rgb = silhouette(&view, rng.random());
    }
    Ok((view, camera))
}

/// The plants of a view white on black, or black on white.
fn silhouette(view: &View, white: bool) -> Rgb {
    Rgb::from_fn(view.rgb.width(), view.rgb.height(), |x, y| {
        let plant = view.instances.get_pixel(x, y).0[0] > 0;
        image::Rgb([if plant == white { 255 } else { 0 }; 3])
    })
}

/// `detail` is how much blur the picture's plants bear, 0..=1.
fn sensor(exposure: f32, detail: f32, size: u32, rng: &mut Seeded) -> Sensor {
    let pixels = detail * size as f32 / 256.0;
    let cast = if rng.random_bool(0.15) { 0.35 } else { 0.15 };
    let tint = |rng: &mut Seeded| rng.random_range(1.0 - cast..1.0 + cast);
    // Before a white wall any flare would leave no plant.
    let flare = rng.random_bool(if exposure < 0.3 { 0.09 } else { 0.0 }).then(|| Flare {
        at: Vec2::new(rng.random_range(-0.2..1.2), rng.random_range(-0.3..0.5)),
        colour: Vec3::new(tint(rng), tint(rng), tint(rng)) * rng.random_range(0.5f32..4.0),
        reach: rng.random_range(0.15..0.9),
    });
    Sensor {
        samples: 2,
        exposure: exposure * rng.random_range(0.7f32..1.35),
        white_balance: Vec3::new(tint(rng), 1.0, tint(rng)),
        blur: if rng.random_bool(0.4) { rng.random_range(0.2..1.4) * pixels } else { 0.0 },
        smear: if rng.random_bool(0.1) {
            Vec2::from_angle(rng.random_range(0.0..std::f32::consts::TAU)) * rng.random_range(1.0..6.0) * pixels
        } else {
            Vec2::ZERO
        },
        vignette: if rng.random_bool(0.3) { rng.random_range(0.0..0.5) } else { 0.0 },
        flare,
        shot_noise: rng.random_range(0.0f32..0.2).powi(2),
        read_noise: rng.random_range(0.0f32..0.1).powi(2),
    }
}

/// A camera looking from `from` at the plants' box so that they fill about `fill` of the picture.
pub(super) fn aim(scene: &Scene, from: DVec3, fill: f64, size: u32, rng: &mut Seeded) -> Pinhole {
    let intrinsics = Intrinsics::from_hfov(size, size, rng.random_range(25f64..110.0).to_radians());
    let (low, high) = scene.bounds();
    let half = (high - low).as_dvec3() * 0.5;
    let look = Pose::looking_at(from, DVec3::ZERO, DVec3::Z).rotation;
    let extent = |axis: DVec3| (axis.abs() * half).element_sum();
    let (across, up, deep) = (extent(look * DVec3::X), extent(look * DVec3::Y), extent(look * DVec3::Z));
    let reach = across.max(up) / fill;
    let distance = reach * intrinsics.fx / (0.5 * f64::from(size)) + 0.5 * deep.min(reach);
    let jitter = DVec3::new(rng.random_range(-0.15..0.15), rng.random_range(-0.15..0.15), 0.0) * reach;
    let target = (low + high).as_dvec3() * 0.5 + look * jitter;
    let mut eye = target + from.normalize() * distance;
    eye.z = eye.z.max(scene.setting.ground.z + 0.05);
    let lean = if rng.random_bool(0.2) { 0.3 } else { 0.06 };
    let up = DVec3::new(lean * rng.random_range(-1.0..1.0), 0.0, 1.0);
    // Straight down has no upright: turn the picture at random instead.
    let down = from.z > 0.95 * from.length();
    let up = if down { direction(rng.random_range(0.0..std::f64::consts::TAU), 0.0).as_dvec3() } else { up };
    Pinhole { intrinsics, world_from_camera: Pose::looking_at(eye, target, up) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Species;
    use crate::species::shipped;
    use crate::world::LabelledMesh;

    fn nursery() -> Nursery {
        let species = |name| -> Species { shipped(name).expect("listed").expect("valid") };
        let mut nursery = Nursery::new(vec![species("soybean"), species("maize")]);
        let plant = super::super::grow(&species("tomato"), 0.3, &mut seeded(1));
        let mesh = LabelledMesh::of(&plant, &species("tomato"), crate::model::Detail::Coarse).expect("valid");
        nursery.add_mesh("tomato", false, mesh);
        nursery
    }

    #[test]
    fn pictures_agree_with_their_labels_and_some_are_silhouettes() {
        // Seedlings of far rows are less than a pixel in smaller pictures.
        const SIZE: u32 = 64;
        let nursery = nursery();
        let (mut plants, mut silhouettes) = (0, 0);
        for seed in 0..150 {
            let (view, camera) = training_view(&nursery, SIZE, seed).expect("valid");
            assert!(camera.intrinsics.validated().is_ok() && camera.world_from_camera.is_valid(), "{seed}");
            for (instance, semantic) in view.instances.pixels().zip(view.semantic.pixels()) {
                assert_eq!(instance.0[0] > 0, semantic.0[0] > 0, "{seed}");
                if let Some(organ) = usize::from(instance.0[0]).checked_sub(1) {
                    assert!(organ < view.organs.len(), "{seed}");
                }
            }
            plants += usize::from(view.instances.pixels().any(|p| p.0[0] > 0));
            let binary = view.rgb.as_raw().iter().all(|c| *c == 0 || *c == 255);
            silhouettes += usize::from(binary);
            if binary {
                let white = |x, y| view.rgb.get_pixel(x, y).0[0] == 255;
                let of = |x, y| view.instances.get_pixel(x, y).0[0] > 0;
                let same = (0..SIZE).all(|x| (0..SIZE).all(|y| white(x, y) == of(x, y)));
                let other = (0..SIZE).all(|x| (0..SIZE).all(|y| white(x, y) != of(x, y)));
                assert!(same || other, "{seed}: a silhouette is the mask or its opposite");
            }
        }
        assert!(plants > 135 && (1..20).contains(&silhouettes), "{plants} {silhouettes}");
    }

    #[test]
    fn a_nursery_without_plants_gives_pictures_without_plants() {
        let view = (0..20).map(|seed| training_view(&Nursery::default(), 16, seed).expect("nothing to refuse").0);
        assert!(view.into_iter().all(|view| view.organs.is_empty()));
    }
}
