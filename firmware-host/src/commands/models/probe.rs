//! One pass of any model on nothing in particular.

use std::num::NonZeroUsize;
use std::path::Path;

use demeter_frame::Rgb;
use demeter_models::{
    DepthNetwork, Layout, Manifest, ModelError, Organ2d, Organ3d, OrganNetwork, Runtime, SamDecoder, SamEncoder, U2net,
};
use demeter_recon::pyramid;
use glam::DVec3;

/// The grey picture that every network is shown: a plain camera's.
const PICTURE: (u32, u32) = (640, 480);
/// Points along each side of the wavy square that networks of points are shown, 16,384 in all.
const POINTS: u32 = 128;

/// A model behind its adapter, with something to run on.
pub(super) struct Probe {
    run: Box<dyn FnMut() -> Result<(), ModelError>>,
}

impl Probe {
    /// Opens the model that a manifest describes: its file is verified on the way.
    pub(super) fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        let grey = Rgb::from_pixel(PICTURE.0, PICTURE.1, image::Rgb([128; 3]));
        let run: Box<dyn FnMut() -> Result<(), ModelError>> = match Manifest::read(path)?.layout {
            Layout::Organ2d => {
                let mut network = Organ2d::open(runtime, path, threads)?;
                Box::new(move || network.run(&grey).map(drop))
            }
            Layout::Organ3d => {
                let mut network = Organ3d::open(runtime, path, threads)?;
                // Finite points always have a pyramid.
                let cloud = pyramid::of(&waves()).ok();
                Box::new(move || cloud.as_ref().map_or(Ok(()), |cloud| network.run(cloud).map(drop)))
            }
            Layout::Relief2d | Layout::DepthAnything | Layout::DepthAnythingMetric | Layout::Meter => {
                let mut network = DepthNetwork::open(runtime, path, threads)?;
                Box::new(move || network.run(&grey).map(drop))
            }
            Layout::TorchvisionMaskRcnn | Layout::Detectron2MaskRcnn | Layout::YoloSeg | Layout::YoloSegNms => {
                let mut network = OrganNetwork::open(runtime, path, threads)?;
                Box::new(move || network.run(&grey).map(drop))
            }
            Layout::U2net => {
                let mut network = U2net::open(runtime, path, threads)?;
                Box::new(move || network.run(&grey).map(drop))
            }
            Layout::SamEncoder | Layout::Sam2Encoder => {
                let mut network = SamEncoder::open(runtime, path, threads)?;
                Box::new(move || network.run(&grey).map(drop))
            }
            Layout::SamDecoder | Layout::Sam2Decoder => {
                let mut network = SamDecoder::open(runtime, path, threads)?;
                let blank = network.blank();
                Box::new(move || network.run(&blank, [0, 0]).map(drop))
            }
        };
        Ok(Self { run })
    }

    /// One pass.
    pub(super) fn run(&mut self) -> Result<(), ModelError> {
        (self.run)()
    }
}

fn waves() -> Vec<DVec3> {
    let at = |i: u32| f64::from(i) / f64::from(POINTS);
    let point = |i, j| DVec3::new(at(i), at(j), 0.1 * (9.0 * at(i)).sin() * (7.0 * at(j)).cos());
    (0..POINTS).flat_map(|i| (0..POINTS).map(move |j| point(i, j))).collect()
}
