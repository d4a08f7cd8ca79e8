//! One picture to the plants in it, in space: network, instances, scale, lifting, grouping.

use std::num::NonZeroUsize;

use demeter_frame::{Intrinsics, Mask, Pose, Rgb};
use demeter_models::{ModelError, OrganMaps, RuntimeError};
use demeter_recon::organs::ScaleSource;
use demeter_recon::view::{self, DepthScale, Dropped, PlantView, Refused, ScaleError, View, ViewError};
use glam::DVec2;

use crate::config::ModelsConfig;
use crate::error::CommandError;
use crate::far;
pub use crate::networks::Degraded;
use crate::networks::{Networks, Scene};

/// Longest side given to the network when the picture holds one plant alone, pixels: twice its usual, because a photo
/// is not in a hurry and thin stems gain by it.
pub const PHOTO_SIDE: u32 = 512;

/// The networks with what follows them.
#[derive(Debug)]
pub struct Eye {
    networks: Networks,
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
    /// Networks beside organ2d that failed on it.
    pub degraded: Vec<Degraded>,
}

impl Eye {
    /// Loads ONNX Runtime, our network and those that the configuration names beside it for rows. One of these that is
    /// missing or refused is left out: see [`Eye::degraded`].
    ///
    /// # Errors
    /// [`EyeError`], whose message says how to mend it.
    pub fn open(config: &ModelsConfig, threads: NonZeroUsize) -> Result<Self, EyeError> {
        Ok(Self { networks: Networks::open(&config.in_rows(), threads)? })
    }

    /// The same for photos, which are looked at closer: [`PHOTO_SIDE`].
    ///
    /// # Errors
    /// As [`Eye::open`].
    pub fn of_photos(config: &ModelsConfig, threads: NonZeroUsize) -> Result<Self, EyeError> {
        Ok(Self { networks: Networks::open(config, threads)?.with_long_side(PHOTO_SIDE)? })
    }

    /// Name and SHA-256 of each network, ours first.
    #[must_use]
    pub fn models(&self) -> Vec<(&str, &str)> {
        let manifests = self.networks.models().into_iter().map(demeter_models::Model::manifest);
        manifests.map(|manifest| (manifest.name.as_str(), manifest.sha256.as_str())).collect()
    }

    /// What is configured and could not be opened.
    #[must_use]
    pub fn degraded(&self) -> &[Degraded] {
        &self.networks.degraded
    }

    /// What our network says of a picture, the camera among it.
    ///
    /// # Errors
    /// [`SightError::Network`] when the network fails.
    pub fn maps(&mut self, picture: &Rgb) -> Result<OrganMaps, SightError> {
        Ok(self.networks.maps(picture)?)
    }

    /// The probability that each pixel shows a plant, at the network's size.
    ///
    /// # Errors
    /// [`SightError::Network`] when the network fails.
    pub fn plants(&mut self, picture: &Rgb) -> Result<Mask, SightError> {
        Ok(self.maps(picture)?.plants())
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
        let maps = self.maps(picture)?;
        self.look_with(picture, maps, camera, world_from_camera)
    }

    /// [`Eye::look`] for a picture of which our network has spoken.
    ///
    /// # Errors
    /// As there.
    pub fn look_with(
        &mut self,
        picture: &Rgb,
        maps: OrganMaps,
        camera: &Intrinsics,
        world_from_camera: Option<Pose>,
    ) -> Result<Sight, SightError> {
        // In a row the same plants soon come near; a photo is all there is.
        let is_far = world_from_camera.is_none() && self.networks.organs_are_ours() && far::is_far(&maps);
        let maps = if is_far { self.networks.maps_at(picture, far::LONG_SIDE)? } else { maps };
        let plants = is_far.then(|| maps.plants());
        let Scene { mut semantic, dist, log_depth, divided, metric, scale: enlargement, degraded } =
            self.networks.scene(picture, maps, camera)?;
        if let Some(plants) = plants {
            far::sharpen(&mut semantic, picture, &plants);
        }
        let (width, height) = semantic.dimensions();
        let view = View {
            semantic: &semantic,
            dist: &dist,
            log_depth: &log_depth,
            intrinsics: camera.resized(width, height),
            world_from_camera,
        }
        .validated()?;
        let scale = match (world_from_camera, metric) {
            (Some(_), _) => view::ground_plane(&view)?,
            (None, true) => DepthScale::METRIC,
            (None, false) => view::nominal(&view)?,
        };
        let (raster, regions) = divided.map_or_else(|| view::instances(&view), |ids| view::divided(&view, &ids));
        let lifted = view::lift(&view, &raster, &regions, scale);
        let (plants, refused) = view::group(&view, &lifted.organs);
        let sights = plants.into_iter().map(|plant| plant.anchored(&view)).map(|plant| PlantSight {
            ground: plant.ground_position(&view),
            off_centre: plant.off_centre(&view),
            bounds: enlarged(plant.bounds, enlargement, picture.dimensions()),
            plant,
        });
        Ok(Sight { plants: sights.collect(), refused, dropped: lifted.dropped, scale_source: scale.source, degraded })
    }
}

/// A box of the network's picture in pixels of the original.
fn enlarged([x0, y0, x1, y1]: [u32; 4], [sx, sy]: [f64; 2], (width, height): (u32, u32)) -> [u32; 4] {
    let low = |v: u32, s: f64| (f64::from(v) * s).floor() as u32;
    let high = |v: u32, s: f64, most: u32| ((f64::from(v + 1) * s).ceil() as u32).min(most);
    [low(x0, sx), low(y0, sy), high(x1, sx, width), high(y1, sy, height)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a plant's provenance names is what looked at it.
    #[test]
    fn rows_are_looked_at_without_the_depth_of_photos_and_with_that_of_others() {
        let config = ModelsConfig::default();
        let rows = Eye::open(&config, NonZeroUsize::MIN).unwrap();
        let photos = Eye::of_photos(&config, NonZeroUsize::MIN).unwrap();
        let names = |eye: &Eye| eye.models().into_iter().map(|(name, _)| name.to_owned()).collect::<Vec<_>>();
        assert_eq!((names(&rows), names(&photos)), (vec!["organ2d".into()], vec!["organ2d".into(), "relief2d".into()]));
        let others = ModelsConfig { depth: "meter".into(), ..config };
        assert_eq!(others.in_rows(), others);
    }
}
