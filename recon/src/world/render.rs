use demeter_frame::{Depth, Instances, Intrinsics, Pinhole, Rgb};
use glam::{Mat3, Vec2, Vec3};
use image::GrayImage;

use super::raster::{Buffer, NONE};
use super::scene::Scene;
use super::shade::{self, Spot};
use super::{Seeded, Sensor, backdrop};

/// An organ of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct OrganRef {
    /// Index of the plant: in [`Scene::plants`], or among the meshes that the scene was made of.
    pub plant: u32,
    /// Index of the organ in the plant.
    pub organ: u32,
}

/// A picture with its truth; all rasters have one size.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// What the camera recorded.
    pub rgb: Rgb,
    /// Metres along the camera's axis, of plants, ground, wall and pots; 0 for the sky.
    pub depth: Depth,
    /// [`demeter_frame::Semantic`] as u8.
    pub semantic: GrayImage,
    /// Organ instances, 0 for background.
    pub instances: Instances,
    /// The organ of each instance id; id 1 is entry 0.
    pub organs: Vec<OrganRef>,
}

/// What one ray saw.
#[derive(Clone, Copy, Default)]
struct Sample {
    light: Vec3,
    depth: f32,
    instance: u16,
}

/// Takes a picture; `rng` drives the sensor's noise alone.
#[must_use]
pub fn render(scene: &Scene, camera: &Pinhole, sensor: &Sensor, rng: &mut Seeded) -> View {
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let side = sensor.samples.clamp(1, 4);
    let fine = Pinhole { intrinsics: camera.intrinsics.resized(width * side, height * side), ..*camera };
    let samples = look(scene, &fine);
    let mut view = View {
        rgb: Rgb::default(),
        depth: Depth::new(width, height),
        semantic: GrayImage::new(width, height),
        instances: Instances::new(width, height),
        organs: scene.looks[1..].iter().map(|l| OrganRef { plant: l.plant, organ: l.organ }).collect(),
    };
    let mut light = Vec::with_capacity((width * height) as usize);
    let mut seen = Vec::with_capacity((side * side) as usize);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        seen.clear();
        for k in 0..side * side {
            let (i, j) = (x * side + k % side, y * side + k / side);
            seen.push(samples[(j * width * side + i) as usize]);
        }
        light.push(seen.iter().map(|s| s.light).sum::<Vec3>() / seen.len() as f32);
        let winner = majority(&seen);
        view.depth.put_pixel(x, y, image::Luma([winner.depth]));
        view.instances.put_pixel(x, y, image::Luma([winner.instance]));
        // Pots are instance 0, whose look is background.
        let semantic = scene.looks[usize::from(winner.instance)].semantic as u8;
        view.semantic.put_pixel(x, y, image::Luma([semantic]));
    }
    view.rgb = sensor.expose(&light, width, height, rng);
    view
}

/// The sample of the instance that most rays saw; of equals the nearest.
fn majority(seen: &[Sample]) -> Sample {
    let votes = |s: &Sample| seen.iter().filter(|o| o.instance == s.instance).count();
    let rank = |s: &Sample| (votes(s), if s.depth > 0.0 { -s.depth } else { f32::NEG_INFINITY });
    let better = |a: &Sample, b: &Sample| {
        let ((av, ad), (bv, bd)) = (rank(a), rank(b));
        av > bv || (av == bv && ad > bd)
    };
    seen.iter().copied().reduce(|a, b| if better(&b, &a) { b } else { a }).unwrap_or_default()
}

/// One ray a pixel: first which face each sees, then the light of that face alone.
fn look(scene: &Scene, camera: &Pinhole) -> Vec<Sample> {
    let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
    let lens = [fx, fy, cx, cy].map(|x| x as f32);
    let world_from_camera = Mat3::from_quat(camera.world_from_camera.rotation.as_quat());
    let eye = camera.world_from_camera.translation.as_vec3();
    let camera_from_world = world_from_camera.transpose();
    let in_camera: Vec<Vec3> = scene.positions.iter().map(|p| camera_from_world * (*p - eye)).collect();
    let mut buffer = Buffer::new(width as usize, height as usize, 0.0);
    for (n, face) in scene.faces.iter().enumerate() {
        let corners = face.map(|v| in_camera[v as usize]);
        match scene.cutout(n) {
            None => buffer.fill_perspective(corners, lens, n as u32),
            Some(cutout) => buffer.fill_perspective_cut(corners, lens, n as u32, cutout),
        }
    }
    let mut samples = Vec::with_capacity(buffer.face.len());
    for (n, (face, inverse)) in buffer.face.iter().zip(&buffer.key).enumerate() {
        let at = Vec2::new((n % buffer.width) as f32 + 0.5, (n / buffer.width) as f32 + 0.5);
        // Its z in the camera is 1, so distances along it are depths.
        let ray = world_from_camera * Vec3::new((at.x - lens[2]) / lens[0], (at.y - lens[3]) / lens[1], 1.0);
        // Leaves that hang below the ground are hidden by it.
        let buried = *face != NONE && backdrop::ground_distance(scene, eye, ray) * inverse < 1.0;
        samples.push(if *face == NONE || buried {
            let seen = backdrop::background(scene, eye, ray);
            let depth = if seen.distance.is_finite() { seen.distance } else { 0.0 };
            Sample { light: seen.colour, depth, instance: 0 }
        } else {
            let instance = scene.instances[*face as usize];
            let spot = spot(scene, *face as usize, eye, ray, 1.0 / inverse);
            let light = shade::organ(scene, &scene.looks[usize::from(instance)], &spot);
            Sample { light, depth: 1.0 / inverse, instance }
        });
    }
    samples
}

/// Position, normal and uv of a face at `depth` along a ray.
fn spot(scene: &Scene, face: usize, eye: Vec3, ray: Vec3, depth: f32) -> Spot {
    let position = eye + ray * depth;
    let corners = scene.faces[face].map(|v| v as usize);
    let [a, b, c] = corners.map(|v| scene.positions[v]);
    let (e, f, p) = (b - a, c - a, position - a);
    let (ee, ef, ff, pe, pf) = (e.dot(e), e.dot(f), f.dot(f), p.dot(e), p.dot(f));
    let scale = 1.0 / (ee * ff - ef * ef).max(1e-20);
    let v = ((ff * pe - ef * pf) * scale).clamp(0.0, 1.0);
    let w = ((ee * pf - ef * pe) * scale).clamp(0.0, 1.0 - v);
    let weights = [1.0 - v - w, v, w];
    let normal: Vec3 = (0..3).map(|i| scene.normals[corners[i]] * weights[i]).sum();
    let uv: Vec2 = (0..3).map(|i| scene.uvs[corners[i]] * weights[i]).sum();
    Spot { position, normal: normal.normalize_or(Vec3::Z), uv, to_eye: -ray.normalize() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Detail, Form, Knots, PlantMesh, Species, forward};
    use crate::species::shipped;
    use crate::world::{
        LabelledMesh, Light, MeshOrgan, Nursery, Row, Setting, StandingMesh, Texture, row, seeded, training_view,
    };
    use demeter_frame::{Pose, Semantic};
    use glam::DVec3;
    use std::sync::Arc;

    fn soybean() -> Species {
        shipped("soybean").expect("listed").expect("valid")
    }

    fn sample(sensor: &Sensor) -> (Scene, Pinhole, View) {
        let intrinsics = Intrinsics::from_hfov(320, 240, 0.8);
        let plan = Row { plants: 4, spacing: 0.25, age: 0.3, frames: 5 };
        let (scene, poses) = row(&soybean(), &plan, &intrinsics, 3).expect("few organs");
        let camera = Pinhole { intrinsics, world_from_camera: poses[2] };
        let view = render(&scene, &camera, sensor, &mut seeded(9));
        (scene, camera, view)
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
        assert_eq!(sample(&Sensor::FIELD).2, sample(&Sensor::FIELD).2);
        let nursery = Nursery::new(vec![soybean(), shipped("maize").expect("listed").expect("valid")]);
        let view = |seed| training_view(&nursery, 48, seed).expect("valid").0;
        assert!((0..8).all(|seed| view(seed) == view(seed) && view(seed) != view(seed + 1)));
    }

    #[test]
    fn masks_agree_with_each_other_and_with_the_plants() {
        for sensor in [Sensor::CLEAN, Sensor { samples: 2, ..Sensor::CLEAN }] {
            let (scene, _, view) = sample(&sensor);
            let organs: usize = scene.plants.iter().map(|p| p.plant.organs.len()).sum();
            assert_eq!(view.organs.len(), organs);
            let mut seen = 0;
            for (x, y, instance) in view.instances.enumerate_pixels() {
                let (id, semantic) = (usize::from(instance.0[0]), view.semantic.get_pixel(x, y).0[0]);
                assert_eq!(id > 0, semantic > 0);
                if id > 0 {
                    seen += 1;
                    assert!(view.depth.get_pixel(x, y).0[0] > 0.0);
                    let OrganRef { plant, organ } = view.organs[id - 1];
                    let leaf =
                        matches!(scene.plants[plant as usize].plant.organs[organ as usize].form, Form::Leaf { .. });
                    assert_eq!(leaf, semantic == 1, "instance {id}");
                }
            }
            assert!(seen > 2000, "{seen} pixels of plants");
        }
    }

    #[test]
    fn depth_is_that_of_the_mesh() {
        let (scene, camera, view) = sample(&Sensor::CLEAN);
        let camera_from_world = camera.world_from_camera.inverse();
        let (mut visible, mut inside, mut behind) = (0, 0, 0);
        for standing in &scene.plants {
            let posed = forward(&standing.plant, &soybean()).expect("valid");
            let mesh = PlantMesh::of(&posed, Detail::Coarse, Knots::Uniform);
            for face in 0..mesh.faces.len() {
                let x: DVec3 = mesh.corners(face).into_iter().sum::<DVec3>() / 3.0;
                let x = camera_from_world.point(x);
                let Some(at) = camera.intrinsics.project(x) else { continue };
                if at.x < 0.0 || at.y < 0.0 || at.x >= 320.0 || at.y >= 240.0 {
                    continue;
                }
                inside += 1;
                let depth = |dx: u32, dy: u32| {
                    let (px, py) = ((at.x as u32 + dx).clamp(1, 320) - 1, (at.y as u32 + dy).clamp(1, 240) - 1);
                    f64::from(view.depth.get_pixel(px, py).0[0])
                };
                visible += usize::from((depth(1, 1) - x.z).abs() < 0.004);
                // At silhouettes a pixel's centre may miss the face, but a neighbour's does not, but for tips.
                behind += usize::from((0..9).all(|k| depth(k % 3, k / 3) > x.z + 0.01));
            }
        }
        assert!(inside > 1000 && visible * 2 > inside && behind * 200 < inside, "{inside} {visible} {behind}");
    }

    /// A horizontal leaf of 1 m x 1 m at a height of 1 m, of which the texture shows the half with smaller x.
    fn half_leaf() -> Scene {
        let picture = image::RgbaImage::from_fn(8, 8, |x, _| image::Rgba([20, 120, 20, if x < 4 { 255 } else { 0 }]));
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let mesh = LabelledMesh {
            positions: corners.iter().map(|(x, y)| Vec3::new(x - 0.5, y - 0.5, 1.0)).collect(),
            normals: vec![Vec3::Z; 4],
            uvs: corners.iter().map(|(x, y)| Vec2::new(*x, *y)).collect(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
            organ_of_face: vec![0, 0],
            organs: vec![MeshOrgan { semantic: Semantic::Leaf, texture: Texture::new(&picture).map(Arc::new) }],
        };
        let standing = StandingMesh { mesh: Arc::new(mesh), world_from_mesh: Pose::IDENTITY, scale: 1.0 };
        let light = Light { to_sun: Vec3::Z, ..Setting::STUDIO.light };
        Scene::of_meshes(&[standing], Setting { light, ..Setting::STUDIO }, 1).expect("one organ")
    }

    #[test]
    fn a_leaf_is_where_its_picture_is_and_so_is_its_shadow() {
        let scene = half_leaf();
        let look = |eye: DVec3, target| {
            let world_from_camera = Pose::looking_at(eye, target, DVec3::Y);
            let camera = Pinhole { intrinsics: Intrinsics::from_hfov(200, 200, 1.0), world_from_camera };
            (camera, render(&scene, &camera, &Sensor::CLEAN, &mut seeded(1)))
        };
        let (camera, view) = look(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO);
        // 2 m above the leaf.
        let pixels_per_metre = camera.intrinsics.fx / 2.0;
        let seen = view.instances.pixels().filter(|p| p.0[0] == 1).count() as f64;
        assert!((seen / (0.5 * pixels_per_metre.powi(2)) - 1.0).abs() < 0.03, "{seen} pixels");
        assert!(view.semantic.pixels().zip(view.instances.pixels()).all(|(s, i)| s.0[0] == u8::from(i.0[0] == 1)));
        // From below the leaf, on the ground: dark under the half that is there, light under the other.
        let (camera, view) = look(DVec3::new(0.0, -0.5, 0.9), DVec3::new(0.0, 0.1, 0.0));
        let ground = |x: f64| {
            let at = camera.world_from_camera.inverse().point(DVec3::new(x, 0.1, 0.0));
            let at = camera.intrinsics.project(at).expect("ahead");
            view.rgb.get_pixel(at.x as u32, at.y as u32).0[1]
        };
        assert!(ground(-0.25) < 150 && ground(0.25) > ground(-0.25) + 40, "{} {}", ground(-0.25), ground(0.25));
    }

    #[test]
    fn an_empty_scene_has_ground_and_no_instances() {
        let (full, camera, _) = sample(&Sensor::CLEAN);
        let setting: Setting = full.setting;
        let scene = Scene::new(Vec::new(), setting, Detail::Coarse, 1).expect("nothing to refuse");
        let view = render(&scene, &camera, &Sensor::CLEAN, &mut seeded(1));
        assert!(view.organs.is_empty());
        assert!(view.instances.pixels().all(|p| p.0[0] == 0));
        assert!(view.semantic.pixels().all(|p| p.0[0] == 0));
        // The picture's middle row looks at the ground: depth follows from the camera's height and pitch.
        let ray = camera.world_from_camera.rotation * camera.intrinsics.unproject(glam::DVec2::new(160.5, 120.5), 1.0);
        let expected = -camera.world_from_camera.translation.z / ray.z;
        let found = f64::from(view.depth.get_pixel(160, 120).0[0]);
        assert!((found - expected).abs() < 1e-4 * expected, "expected {expected}, found {found}");
    }
}
