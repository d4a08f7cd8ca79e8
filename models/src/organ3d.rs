use std::num::NonZeroUsize;
use std::path::Path;

use demeter_frame::{ABOVE, LOCAL, NEIGHBOURS, PointMaps, PointPyramid};
use ndarray::{Array1, Array2};

use crate::{Layout, Model, ModelError, Port, Runtime, Tensor};

/// Our network for organs in point clouds: a U-Net over points trained by models/training/train_organ3d.py, in the role
/// of PointTransformer-V3 (spec/models.md, "Our networks").
///
/// The graph takes what a [`PointPyramid`] holds, f32 coordinates and i64 indices, and gives the logits `semantic`
/// `[n, 3]` and `boundary` `[n, 1]` in 0..=1.
#[derive(Debug)]
pub struct Organ3d {
    model: Model,
}

impl Organ3d {
    /// Opens the network that the manifest at `path` describes (see [`crate::find_manifest`]), on `threads` threads.
    ///
    /// # Errors
    /// Those of [`Model::open`], and [`ModelError::Ports`] when the manifest describes another kind of network.
    pub fn open(runtime: &Runtime, path: &Path, threads: NonZeroUsize) -> Result<Self, ModelError> {
        let model = Model::open_as(runtime, path, threads, &[Layout::Organ3d])?;
        model.needs(&inputs(), &outputs())?;
        Ok(Self { model })
    }

    /// The verified model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Runs the network on a cloud; the maps have one entry for each of its points.
    ///
    /// # Errors
    /// [`ModelError::Session`] for indices that point nowhere, [`ModelError::Shape`], and those of [`Model::run`].
    pub fn run(&mut self, cloud: &PointPyramid) -> Result<PointMaps, ModelError> {
        let [first, second, third] = &cloud.levels;
        let outputs = self.model.run(&[
            ("points", floats(&cloud.points)),
            ("points0", floats(&cloud.finest)),
            ("points1", floats(&first.points)),
            ("points2", floats(&second.points)),
            ("points3", floats(&third.points)),
            ("up", indices(&cloud.up)),
            ("below1", indices(&first.below)),
            ("below2", indices(&second.below)),
            ("below3", indices(&third.below)),
            ("beside1", indices(&first.beside)),
            ("beside2", indices(&second.beside)),
            ("beside3", indices(&third.beside)),
            ("parent1", Array1::from_vec(first.parent.clone()).into()),
            ("parent2", Array1::from_vec(second.parent.clone()).into()),
            ("local", floats(&cloud.local)),
        ])?;
        let points = cloud.points.len() as i64;
        let semantic = outputs.f32("semantic", [points, PointMaps::CLASSES.len() as i64])?;
        let boundary = outputs.f32("boundary", [points, 1])?;
        let probabilities = semantic.outer_iter().map(|logits| softmax([logits[0], logits[1], logits[2]])).collect();
        Ok(PointMaps { probabilities, boundary: boundary.iter().copied().collect() })
    }
}

/// The largest logit is taken off first so that nothing overflows.
fn softmax(logits: [f32; 3]) -> [f32; 3] {
    let most = logits.into_iter().fold(f32::NEG_INFINITY, f32::max);
    let odds = logits.map(|logit| (logit - most).exp());
    odds.map(|x| x / odds.iter().sum::<f32>())
}

fn floats<const N: usize>(rows: &[[f32; N]]) -> Tensor {
    Array2::from(rows.to_vec()).into()
}

fn indices<const N: usize>(rows: &[[i64; N]]) -> Tensor {
    Array2::from(rows.to_vec()).into()
}

fn port(name: &str, columns: Option<usize>, dtype: &str) -> Port {
    let shape = std::iter::once(-1).chain(columns.map(|n| n as i64)).collect();
    Port { name: name.into(), shape, dtype: dtype.into() }
}

fn inputs() -> Vec<Port> {
    let points = ["points", "points0", "points1", "points2", "points3"].map(|name| port(name, Some(3), "f32"));
    let near = ["below1", "below2", "below3", "beside1", "beside2", "beside3"];
    let near = near.map(|name| port(name, Some(NEIGHBOURS), "i64"));
    let parents = ["parent1", "parent2"].map(|name| port(name, None, "i64"));
    let up = [port("up", Some(ABOVE), "i64")];
    points.into_iter().chain(up).chain(near).chain(parents).chain([port("local", Some(LOCAL), "f32")]).collect()
}

fn outputs() -> Vec<Port> {
    vec![port("semantic", Some(PointMaps::CLASSES.len()), "f32"), port("boundary", Some(1), "f32")]
}
