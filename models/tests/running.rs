//! Maps of a network whose every answer is known: properties first, then bad outputs.
#![allow(clippy::unwrap_used, missing_docs)]

mod graph;

use std::num::NonZeroUsize;

use demeter_frame::Rgb;
use demeter_models::{ModelError, Organ2d, OrganMaps, Runtime};
use graph::{Graph, manifest, write};

fn run(graph: &Graph, image: &Rgb) -> Result<OrganMaps, ModelError> {
    let folder = tempfile::tempdir().unwrap();
    let onnx = graph.onnx();
    let path = write(folder.path(), &onnx, &manifest(&onnx));
    Organ2d::open(&Runtime::load(None).unwrap(), &path, NonZeroUsize::MIN)?.with_long_side(64)?.run(image)
}

/// A picture whose colours say where they are.
fn picture(width: u32, height: u32) -> Rgb {
    Rgb::from_fn(width, height, |x, y| image::Rgb([(x * 3 % 256) as u8, (y * 5 % 256) as u8, ((x + y) % 256) as u8]))
}

#[test]
fn maps_have_the_working_size_probabilities_sum_to_one_and_scale_leads_back() {
    for (width, height) in [(1, 1), (7, 300), (640, 480), (64, 48), (65, 33)] {
        let maps = run(&Graph::default(), &picture(width, height)).unwrap();
        let (w, h) = maps.dist.dimensions();
        assert!(w % 16 == 0 && h % 16 == 0 && w.max(h) == 64, "{w} x {h}");
        assert_eq!(maps.log_depth.dimensions(), (w, h));
        let back = [maps.scale[0] * f64::from(w), maps.scale[1] * f64::from(h)];
        assert!((back[0] - f64::from(width)).abs() < 1e-9 && (back[1] - f64::from(height)).abs() < 1e-9);
        for (x, y, _) in maps.dist.enumerate_pixels() {
            let sum: f32 = maps.probabilities.iter().map(|class| class.get_pixel(x, y).0[0]).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum} at {x}, {y}");
        }
    }
}

#[test]
fn channels_and_pixels_stay_where_they_are() {
    // At the working size nothing is resized, so every value follows from its own pixel.
    let image = picture(64, 48);
    let maps = run(&Graph::default(), &image).unwrap();
    for (x, y, pixel) in image.enumerate_pixels() {
        let [r, g, b] = pixel.0.map(|value| f32::from(value) / 255.0);
        let exp = [0.0, r, g, b].map(f32::exp);
        for (class, map) in maps.probabilities.iter().enumerate() {
            let (found, expected) = (map.get_pixel(x, y).0[0], exp[class] / exp.iter().sum::<f32>());
            assert!((found - expected).abs() < 1e-5, "class {class} at {x}, {y}: {found}, expected {expected}");
        }
        assert!((maps.dist.get_pixel(x, y).0[0] - g).abs() < 1e-5);
        assert!((maps.log_depth.get_pixel(x, y).0[0] - (r - b)).abs() < 1e-5);
    }
    let pure = |rgb| run(&Graph::default(), &Rgb::from_pixel(20, 20, image::Rgb(rgb))).unwrap().semantic();
    for (rgb, class) in [([255, 0, 0], 1), ([0, 255, 0], 2), ([0, 0, 255], 3)] {
        assert!(pure(rgb).pixels().all(|pixel| pixel.0[0] == class), "{rgb:?} is not class {class}");
    }
}

#[test]
fn the_camera_is_of_the_original_picture() {
    // Up is (0, 0.8, 0.6) in the network's picture, which is 64 x 48 or, of a picture of 100 x 70, taller than it was.
    let colour = image::Rgb([0, 204, 153]);
    let whole = run(&Graph::default(), &Rgb::from_pixel(640, 480, colour)).unwrap().camera;
    assert!((whole.hfov - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{whole:?}");
    assert!((whole.tilt.pitch - 0.6f64.asin()).abs() < 1e-5, "{whole:?}");
    let rounded = run(&Graph::default(), &Rgb::from_pixel(100, 70, colour)).unwrap().camera;
    let stretch = (48.0 / 64.0) / (70.0 / 100.0);
    assert!((rounded.tilt.pitch - 0.6f64.atan2(0.8 / stretch)).abs() < 1e-5, "{rounded:?}");
}

#[test]
fn two_runs_agree_to_the_last_bit() {
    let image = picture(200, 100);
    assert_eq!(run(&Graph::default(), &image).unwrap(), run(&Graph::default(), &image).unwrap());
}

#[test]
fn large_logits_do_not_overflow() {
    let graph = Graph { sem: vec![[0.0; 3], [1e30, 0.0, 0.0], [0.0; 3], [-1e30, 0.0, 0.0]], ..Graph::default() };
    let maps = run(&graph, &Rgb::from_pixel(16, 16, image::Rgb([255; 3]))).unwrap();
    assert!(maps.probabilities[1].pixels().all(|p| p.0[0] == 1.0));
}

#[test]
fn outputs_that_are_not_numbers_are_errors() {
    let white = Rgb::from_pixel(16, 16, image::Rgb([255; 3]));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for (output, graph) in [
            ("sem", Graph { sem: vec![[bad, 0.0, 0.0]; 4], ..Graph::default() }),
            ("dist", Graph { dist: vec![[0.0, bad, 0.0]], ..Graph::default() }),
            ("depth", Graph { depth: vec![[0.0, 0.0, bad]], ..Graph::default() }),
            ("camera", Graph { camera: vec![[bad, 0.0, 0.0]; 6], ..Graph::default() }),
        ] {
            let error = run(&graph, &white).unwrap_err();
            assert!(matches!(&error, ModelError::NotFinite { output: o, .. } if o == output), "{output}: {error}");
        }
    }
}

#[test]
fn an_output_of_another_size_is_an_error() {
    let error = run(&Graph { dist_stride: 2, ..Graph::default() }, &picture(64, 64)).unwrap_err();
    let ModelError::Shape { output, expected, found, .. } = error else { panic!("{error}") };
    assert_eq!((output.as_str(), expected, found), ("dist", vec![1, 1, 64, 64], vec![1, 1, 32, 32]));
}

#[test]
fn images_and_sizes_that_are_none_are_errors() {
    let error = run(&Graph::default(), &Rgb::new(0, 5)).unwrap_err();
    assert!(matches!(error, ModelError::EmptyImage { width: 0, height: 5 }), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let onnx = Graph::default().onnx();
    let path = write(folder.path(), &onnx, &manifest(&onnx));
    for side in [0, 8, 100, 2064] {
        let organ2d = Organ2d::open(&Runtime::load(None).unwrap(), &path, NonZeroUsize::MIN).unwrap();
        let error = organ2d.with_long_side(side).unwrap_err();
        assert!(matches!(error, ModelError::LongSide { found } if found == side), "{error}");
    }
}
