//! A cloud's organs: by its labels, else by our network over points, else by geometry alone.

use std::num::NonZeroUsize;

use clap::ValueEnum;
use demeter_frame::PointMaps;
use demeter_models::{Organ3d, Runtime, find_manifest};
use demeter_recon::cloud::PointCloud;
use demeter_recon::model::Species;
use demeter_recon::pyramid;
use demeter_recon::segment::{Labels, SegmentError, Segmented, Up, segment, segment_predicted};
use glam::{DQuat, DVec3};

use crate::error::chain;
use crate::eye::EyeError;

/// Name of the network's manifest.
const NETWORK: &str = "organ3d";

/// What finds organs that no label tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum OrganSource {
    /// Our network over points, with geometry.
    #[default]
    Network,
    /// Geometry alone.
    Geometry,
}

impl OrganSource {
    /// Its name, as the command line has it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Network => "network",
            Self::Geometry => "geometry",
        }
    }
}

/// Divides clouds; the network is opened when the first cloud needs it.
#[derive(Debug)]
pub struct Divider {
    source: OrganSource,
    network: Option<Result<Organ3d, String>>,
}

/// A cloud divided.
#[derive(Debug)]
pub struct Divided {
    /// Its organs.
    pub segmented: Segmented,
    /// What found them, where it was the network.
    pub network: Option<String>,
    /// Why it was not, where it should have been.
    pub degraded: Option<String>,
}

impl Divider {
    /// One that asks `source` where there are no labels.
    #[must_use]
    pub fn new(source: OrganSource) -> Self {
        Self { source, network: None }
    }

    /// Divides a cloud into organs. A network that is missing or fails is no error: geometry does it instead.
    ///
    /// # Errors
    /// [`SegmentError`] of the cloud.
    pub fn divide(
        &mut self,
        cloud: &PointCloud,
        species: &Species,
        labels: Labels,
        up: Up,
    ) -> Result<Divided, SegmentError> {
        let labelled = match labels {
            Labels::Own => true,
            Labels::Auto => cloud.labels.is_some() || cloud.organs.is_some(),
            Labels::None => false,
        };
        let by_geometry =
            |degraded| Ok(Divided { segmented: segment(cloud, species, labels, up)?, network: None, degraded });
        if labelled || self.source == OrganSource::Geometry {
            return by_geometry(None);
        }
        let axis = up.of(&cloud.points);
        match self.look(&cloud.points, axis) {
            Ok((maps, name)) => {
                let segmented = segment_predicted(&cloud.points, &maps, species, Up::Axis(axis))?;
                Ok(Divided { segmented, network: Some(name), degraded: None })
            }
            Err(why) => by_geometry(Some(format!("{NETWORK}: {why}; organs were found by geometry alone"))),
        }
    }

    /// What the network says of the points, and which network it is; else why it says nothing.
    fn look(&mut self, points: &[DVec3], up: DVec3) -> Result<(PointMaps, String), String> {
        let network = self.network.get_or_insert_with(|| open().map_err(|error| chain(&error)));
        let network = network.as_mut().map_err(|why| why.clone())?;
        // The network learned plants that stand on z.
        let upright = DQuat::from_rotation_arc(up, DVec3::Z);
        let points: Vec<DVec3> = points.iter().map(|p| upright * *p).collect();
        let pyramid = pyramid::of(&points).map_err(|error| chain(&error))?;
        let maps = network.run(&pyramid).map_err(|error| chain(&error))?;
        let manifest = network.model().manifest();
        Ok((maps, format!("{} {}", manifest.name, manifest.sha256.get(..8).unwrap_or_default())))
    }
}

fn open() -> Result<Organ3d, EyeError> {
    let runtime = Runtime::load(None)?;
    Ok(Organ3d::open(&runtime, &find_manifest(NETWORK)?, NonZeroUsize::MIN)?)
}
