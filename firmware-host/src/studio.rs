//! Pictures of plants in a plain room, seen from the front.

use demeter_frame::{Intrinsics, Pinhole, Pose};
use demeter_recon::model::{Detail, Plant, Species};
use demeter_recon::world::{Scene, Sensor, Setting, render, seeded};
use glam::DVec3;

use crate::error::CommandError;
use crate::picture::png;

/// Horizontal angle of view: a longer lens would flatten plants, a shorter one bulge them.
const FIELD_OF_VIEW_DEGREES: f64 = 40.0;
/// Share of the picture that the plants may fill.
const FILL: f64 = 0.85;
/// How far above the plants' middle the eye stands, in distances: enough to see blades from above.
const ABOVE: f64 = 0.15;

/// A PNG `[width, height]` of plants where they stand.
///
/// # Errors
/// [`CommandError`] `world` when a plant cannot be posed.
pub fn picture(plants: Vec<(&Species, Plant)>, [width, height]: [u32; 2], seed: u64) -> Result<Vec<u8>, CommandError> {
    let failed = |error: &dyn std::error::Error| CommandError::failed("world", error);
    let scene = Scene::new(plants, Setting::STUDIO, Detail::Control, seed).map_err(|error| failed(&error))?;
    let (low, high) = scene.bounds();
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let slope = (FIELD_OF_VIEW_DEGREES.to_radians() * 0.5).tan() * FILL;
    // The front of the box must fit in both directions.
    let distance = half.y + (half.x.max(half.z * f64::from(width) / f64::from(height)) / slope).max(1e-3);
    let camera = Pinhole {
        intrinsics: Intrinsics::from_hfov(width, height, FIELD_OF_VIEW_DEGREES.to_radians()),
        world_from_camera: Pose::looking_at(middle + DVec3::new(0.0, -1.0, ABOVE) * distance, middle, DVec3::Z),
    };
    let sensor = Sensor { samples: 2, exposure: 0.5, ..Sensor::CLEAN };
    let view = render(&scene, &camera, &sensor, &mut seeded(seed));
    png(&view.rgb).map_err(|error| failed(&error))
}
