//! The shipped network computes in Rust what it computed in Python.
#![allow(clippy::unwrap_used, missing_docs)]

use std::num::NonZeroUsize;

use demeter_frame::Rgb;
use demeter_models::{Model, Organ2d, Outputs, Runtime, find_manifest};
use ndarray::{Array4, s};
use serde::Deserialize;

/// Largest difference allowed between ONNX Runtime here and PyTorch there, both in single precision, in each output's
/// own unit (logits, 0..=1, log depth). Kernels differ in the order of their sums and in how they fold batch
/// normalisation: some thousand terms a sum over thirty layers may cost 1e-4 of logits near ten on another processor's
/// kernels. Measured on x86-64 with AVX-512: 1e-6.
const TOLERANCE: f32 = 1e-3;

#[derive(Deserialize)]
struct Pins {
    height: usize,
    width: usize,
    pins: Vec<Pin>,
}

#[derive(Deserialize)]
struct Pin {
    output: String,
    /// Channel, row and column; of the camera the number alone.
    at: Vec<usize>,
    value: f32,
}

impl Pin {
    fn found(&self, outputs: &Outputs) -> f32 {
        match self.at[..] {
            [c, y, x] => outputs.f32(&self.output, [1, -1, -1, -1]).unwrap()[[0, c, y, x]],
            [number] => outputs.f32(&self.output, [1, -1]).unwrap()[[0, number]],
            _ => panic!("{} numbers for a place", self.at.len()),
        }
    }
}

/// `pinned_image` of models/training/export2d.py.
fn image(pins: &Pins) -> Array4<f32> {
    Array4::from_shape_fn((1, 3, pins.height, pins.width), |(_, c, y, x)| {
        ((x * x * (c + 1) + y * y * (3 - c) + 17 * x * y) % 251) as f32 / 250.0
    })
}

const PINNED: [&str; 2] = ["organ2d", "relief2d"];

fn pins(name: &str) -> Pins {
    let path = find_manifest(name).unwrap().with_file_name(format!("{name}.pins.json"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn model(name: &str) -> Model {
    Model::open(&Runtime::load(None).unwrap(), &find_manifest(name).unwrap(), NonZeroUsize::MIN).unwrap()
}

#[test]
fn outputs_are_those_that_python_pinned() {
    for name in PINNED {
        let (pins, mut model) = (pins(name), model(name));
        let outputs = model.run(&[("image", image(&pins).into())]).unwrap();
        let mut largest = 0f32;
        for pin in &pins.pins {
            let (Pin { output, at, value }, found) = (pin, pin.found(&outputs));
            let difference = (found - value).abs();
            assert!(difference <= TOLERANCE, "{name} {output} {at:?}: found {found}, pinned {value}");
            largest = largest.max(difference);
        }
        assert!(pins.pins.len() >= 9, "{name}: {} pins", pins.pins.len());
        eprintln!("{name}: largest difference of {} pins: {largest:e}", pins.pins.len());
    }
}

#[test]
fn pins_notice_another_image() {
    // The negative control: with one channel darker, most pins must fail.
    for name in PINNED {
        let pins = pins(name);
        let mut image = image(&pins);
        image.slice_mut(s![0, 1, .., ..]).mapv_inplace(|value| value * 0.9);
        let outputs = model(name).run(&[("image", image.into())]).unwrap();
        let moved = pins.pins.iter().filter(|pin| (pin.found(&outputs) - pin.value).abs() > TOLERANCE);
        assert!(moved.count() * 2 > pins.pins.len(), "{name}");
    }
}

#[test]
fn two_sessions_agree_to_the_last_bit() {
    let picture = Rgb::from_fn(640, 480, |x, y| image::Rgb([(x / 3) as u8, (y / 2) as u8, ((x * y) / 700) as u8]));
    let run = || {
        let runtime = Runtime::load(None).unwrap();
        Organ2d::open(&runtime, &find_manifest("organ2d").unwrap(), NonZeroUsize::MIN).unwrap().run(&picture).unwrap()
    };
    let maps = run();
    assert_eq!(maps, run());
    assert_eq!(maps.dist.dimensions(), (384, 288));
    assert!(maps.dist.pixels().all(|pixel| (0.0..=1.0).contains(&pixel.0[0])));
}
