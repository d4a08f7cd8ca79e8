use std::num::NonZeroUsize;
use std::path::Path;

use demeter_frame::{Depth, Rgb};
use image::ImageBuffer;

use crate::{DepthAnything, Layout, Meter, Model, ModelError, Relief2d, Runtime};

/// The least inverse depth told apart from none, as a share of the picture's largest: relative networks put the sky at
/// 0, where the logarithm ends (a guess: 50 times the distance of what is nearest).
const LEAST_INVERSE: f32 = 0.02;

/// What a network says of depth, at the picture's size.
#[derive(Clone, Debug, PartialEq)]
pub enum DepthMap {
    /// Metres along the camera's axis.
    Metric(Depth),
    /// Inverse depth; its scale is unknown, and its shift is taken to be 0, at infinity.
    RelativeInverse(Depth),
    /// Natural logarithm of depth, up to one additive constant.
    RelativeLog(Depth),
}

impl DepthMap {
    /// Natural logarithm of depth along the camera's axis, of metres or up to one additive constant; NaN where there is
    /// none.
    #[must_use]
    pub fn log_depth(&self) -> Depth {
        let (map, log): (_, &dyn Fn(f32) -> f32) = match self {
            Self::Metric(map) => (map, &|z| if z > 0.0 { z.ln() } else { f32::NAN }),
            Self::RelativeInverse(map) => {
                let most = map.iter().copied().fold(0.0, f32::max);
                let log = move |inverse: f32| -inverse.max(LEAST_INVERSE * most).ln();
                (map, &move |inverse| if most > 0.0 { log(inverse) } else { f32::NAN })
            }
            Self::RelativeLog(map) => (map, &|log| log),
        };
        let logs = map.iter().map(|&value| log(value)).collect();
        // As many values as pixels.
        ImageBuffer::from_raw(map.width(), map.height(), logs).unwrap_or_default()
    }
}

/// A network that gives depth.
#[derive(Debug)]
pub enum DepthNetwork {
    /// Depth Anything, of either kind.
    DepthAnything(DepthAnything),
    /// METER.
    Meter(Meter),
    /// Ours.
    Relief2d(Relief2d),
}

impl DepthNetwork {
    /// Opens the network that the manifest at `path` describes, on `threads` threads.
    ///
    /// # Errors
    /// Those of [`Model::open`], and [`ModelError::Ports`] when it is no depth network.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        let layouts = [Layout::DepthAnything, Layout::DepthAnythingMetric, Layout::Meter, Layout::Relief2d];
        let model = Model::open_as(runtime, path, threads, &layouts)?;
        Ok(match model.manifest().layout {
            Layout::Meter => Self::Meter(Meter::new(model)),
            Layout::Relief2d => Self::Relief2d(Relief2d::new(model)?),
            _ => Self::DepthAnything(DepthAnything::new(model)?),
        })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        match self {
            Self::DepthAnything(network) => network.model(),
            Self::Meter(network) => network.model(),
            Self::Relief2d(network) => network.model(),
        }
    }

    /// Depth of every pixel.
    ///
    /// # Errors
    /// [`ModelError`]: an empty picture, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<DepthMap, ModelError> {
        match self {
            Self::DepthAnything(network) => network.run(image),
            Self::Meter(network) => network.run(image),
            Self::Relief2d(network) => network.run(image),
        }
    }
}
