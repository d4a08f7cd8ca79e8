//! One picture to the plants in it, in space: network, instances, scale, lifting, grouping.

use std::num::NonZeroUsize;

use demeter_frame::{Intrinsics, Pose, Rgb};
use demeter_models::{ModelError, Organ2d, Runtime, RuntimeError, find_manifest};
use demeter_recon::organs::ScaleSource;
use demeter_recon::view::{self, Dropped, PlantView, Refused, ScaleError, View, ViewError};
use glam::DVec2;

use crate::error::CommandError;

/// Name of the network's manifest.
const NETWORK: &str = "organ2d";
/// Longest side given to the network when the picture holds one plant alone, pixels: twice its usual, because a photo
/// is not in a hurry and thin stems gain by it.
pub const PHOTO_SIDE: u32 = 512;

/// The network with what follows it.
#[derive(Debug)]
pub struct Eye {
    network: Organ2d,
}

/// Why there is no network.
#[derive(Debug, thiserror::Error)]
pub enum EyeError {
    /// ONNX Runtime is missing or broken.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// The model is missing or refused.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl From<EyeError> for CommandError {
    fn from(error: EyeError) -> Self {
        match error {
            EyeError::Runtime(error) => Self::failed("onnxruntime", &error),
            EyeError::Model(error) => Self::failed("model", &error),
        }
    }
}

/// Why a picture shows nothing.
#[derive(Debug, thiserror::Error)]
pub enum SightError {
    /// The network failed on it.
    #[error(transparent)]
    Network(#[from] ModelError),
    /// The camera is impossible.
    #[error(transparent)]
    View(#[from] ViewError),
    /// Its depth cannot be brought to metres.
    #[error(transparent)]
    Scale(#[from] ScaleError),
}

impl SightError {
    /// A stable word for counters and events.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Network(_) => "network",
            Self::View(_) => "bad_camera",
            Self::Scale(ScaleError::NoDepth) => "no_plant",
            Self::Scale(_) => "no_scale",
        }
    }
}

/// A plant in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSight {
    /// Its organs, in the world when the camera's place is known, else in the camera's frame.
    pub plant: PlantView,
    /// Where it stands on the ground, metres; means something in the world only.
    pub ground: DVec2,
    /// How far from the picture's middle it is, 0 to 1.
    pub off_centre: f64,
    /// Its box in pixels of the picture: `[x0, y0, x1, y1]`, the last not included.
    pub bounds: [u32; 4],
}

/// What a picture shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    /// Its plants, largest first.
    pub plants: Vec<PlantSight>,
    /// Organs that make no plant.
    pub refused: Vec<Refused>,
    /// Instances that were no organs.
    pub dropped: Vec<Dropped>,
    /// Where metres come from.
    pub scale_source: ScaleSource,
}

impl Eye {
    /// Loads ONNX Runtime and our network.
    ///
    /// # Errors
    /// [`EyeError`], whose message says how to mend it.
    pub fn open(threads: NonZeroUsize) -> Result<Self, EyeError> {
        let runtime = Runtime::load(None)?;
        Ok(Self { network: Organ2d::open(&runtime, &find_manifest(NETWORK)?, threads)? })
    }

    /// The same, looking closer: [`PHOTO_SIDE`].
    ///
    /// # Errors
    /// [`EyeError`] when the network does not take that size.
    pub fn closer(self) -> Result<Self, EyeError> {
        Ok(Self { network: self.network.with_long_side(PHOTO_SIDE)? })
    }

    /// Name and SHA-256 of the network.
    #[must_use]
    pub fn model(&self) -> (&str, &str) {
        let manifest = self.network.model().manifest();
        (&manifest.name, &manifest.sha256)
    }

    /// Looks at a picture. With a place in the world the ground gives metres; without one the plants are put at 1 m.
    ///
    /// # Errors
    /// [`SightError`] when the picture as a whole gives nothing; a picture without plants is no error.
    pub fn look(
        &mut self,
        picture: &Rgb,
        camera: &Intrinsics,
        world_from_camera: Option<Pose>,
    ) -> Result<Sight, SightError> {
        let maps = self.network.run(picture)?;
        let (width, height) = maps.dist.dimensions();
        let semantic = maps.semantic();
        let view = View {
            semantic: &semantic,
            dist: &maps.dist,
            log_depth: &maps.log_depth,
            intrinsics: camera.resized(width, height),
            world_from_camera,
        }
        .validated()?;
        let scale = if world_from_camera.is_some() { view::ground_plane(&view)? } else { view::nominal(&view)? };
        let (raster, regions) = view::instances(&view);
        let lifted = view::lift(&view, &raster, &regions, scale);
        let (plants, refused) = view::group(&view, &lifted.organs);
        let sights = plants.into_iter().map(|plant| plant.anchored(&view)).map(|plant| PlantSight {
            ground: plant.ground_position(&view),
            off_centre: plant.off_centre(&view),
            bounds: enlarged(plant.bounds, maps.scale, picture.dimensions()),
            plant,
        });
        Ok(Sight { plants: sights.collect(), refused, dropped: lifted.dropped, scale_source: scale.source })
    }
}

/// A box of the network's picture in pixels of the original.
fn enlarged([x0, y0, x1, y1]: [u32; 4], [sx, sy]: [f64; 2], (width, height): (u32, u32)) -> [u32; 4] {
    let low = |v: u32, s: f64| (f64::from(v) * s).floor() as u32;
    let high = |v: u32, s: f64, most: u32| ((f64::from(v + 1) * s).ceil() as u32).min(most);
    [low(x0, sx), low(y0, sy), high(x1, sx, width), high(y1, sy, height)]
}
