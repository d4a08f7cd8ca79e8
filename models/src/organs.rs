use std::num::NonZeroUsize;
use std::path::Path;

use demeter_frame::{Rgb, Semantic};

use crate::{Instance, Layout, MaskRcnn, Model, ModelError, Runtime, YoloSeg};

/// A network that finds organs one by one.
#[derive(Debug)]
pub enum OrganNetwork {
    /// Mask R-CNN, of either project.
    MaskRcnn(MaskRcnn),
    /// YOLO, with or without suppression inside.
    YoloSeg(YoloSeg),
}

impl OrganNetwork {
    /// Opens the network that the manifest at `path` describes, on `threads` threads.
    ///
    /// # Errors
    /// Those of [`Model::open`], [`ModelError::Ports`] when it finds no instances, and [`ModelError::Classes`] when its
    /// manifest says of no class that it is an organ.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        use Layout::{Detectron2MaskRcnn, TorchvisionMaskRcnn, YoloSeg as Yolo, YoloSegNms};
        let layouts = [TorchvisionMaskRcnn, Detectron2MaskRcnn, Yolo, YoloSegNms];
        let model = Model::open_as(runtime, path, threads, &layouts)?;
        let manifest = model.manifest();
        if manifest.classes.iter().all(|&class| class == Semantic::Background) {
            return Err(ModelError::Classes { name: manifest.name.clone() });
        }
        Ok(match manifest.layout {
            Yolo | YoloSegNms => Self::YoloSeg(YoloSeg::new(model)?),
            _ => Self::MaskRcnn(MaskRcnn::new(model)),
        })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        match self {
            Self::MaskRcnn(network) => network.model(),
            Self::YoloSeg(network) => network.model(),
        }
    }

    /// The organs of a picture, the surest first.
    ///
    /// # Errors
    /// [`ModelError`]: an empty picture, an output of another shape, and those of [`Model::run`].
    pub fn run(&mut self, image: &Rgb) -> Result<Vec<Instance>, ModelError> {
        match self {
            Self::MaskRcnn(network) => network.run(image),
            Self::YoloSeg(network) => network.run(image),
        }
    }
}
