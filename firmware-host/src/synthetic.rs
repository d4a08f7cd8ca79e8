//! The synthetic camera: a rig that drives along a synthetic row.

use std::io;

use demeter_capture::{Manifest, Row as SownRow, SCHEMA_VERSION, SessionCamera, Source, SourceError};
use demeter_frame::{CameraId, Frame, Intrinsics, Pinhole, PixelFormat, Pose, Stamp};
use demeter_recon::model::Species;
use demeter_recon::world::{self, Row, Scene, Sensor, WorldError, seeded};
use image::codecs::jpeg::JpegEncoder;

/// Quality of the frames, as field cameras' MJPEG has it (a guess).
const JPEG_QUALITY: u8 = 90;

/// Time from frame to frame: 5 a second.
const FRAME_NS: u64 = 200_000_000;

/// When synthetic time begins, seconds since 1970: 2026-06-01 08:00 UTC.
const START_SECONDS: i64 = 1_780_300_800;

/// Frames of a synthetic row, one for each pose, made when asked for.
pub struct Synthetic {
    /// The row and its truth.
    pub scene: Scene,
    /// Where the camera stands for each frame.
    pub poses: Vec<Pose>,
    /// The camera's name.
    pub camera: CameraId,
    intrinsics: Intrinsics,
    boot_id: String,
    seed: u64,
    next: usize,
}

impl Synthetic {
    /// A rig before a new row; the same seed gives the same bytes.
    ///
    /// # Errors
    /// [`WorldError`] when the row has more organs than a scene holds.
    pub fn new(
        species: &Species,
        plan: &Row,
        intrinsics: Intrinsics,
        seed: u64,
        boot_id: String,
    ) -> Result<Self, WorldError> {
        let (scene, poses) = world::row(species, plan, &intrinsics, seed)?;
        Ok(Self { scene, poses, camera: CameraId("side".into()), intrinsics, boot_id, seed, next: 0 })
    }

    /// The session that the frames belong to; `plan` is the row that they were made from.
    #[must_use]
    pub fn manifest(&self, species: &str, plan: &Row) -> Manifest {
        let camera = SessionCamera {
            id: self.camera.clone(),
            height_above_ground_m: self.poses.first().map(|pose| pose.translation.z),
            intrinsics: self.intrinsics,
            distortion: None,
            rig_from_camera: None,
        };
        Manifest {
            schema_version: SCHEMA_VERSION,
            rig_id: "synthetic".into(),
            session_id: self.boot_id.clone(),
            species: species.into(),
            cameras_from_antenna_m: None,
            cameras: vec![camera],
            rows: vec![SownRow { row: "1".into(), plot: None, plant_spacing_m: Some(plan.spacing) }],
        }
    }

    fn frame(&self, seq: usize) -> io::Result<Frame> {
        let camera = Pinhole { intrinsics: self.intrinsics, world_from_camera: self.poses[seq] };
        let mut rng = seeded(self.seed.wrapping_add(1 + seq as u64));
        let view = world::render(&self.scene, &camera, &Sensor::FIELD, &mut rng);
        let mut bytes = Vec::new();
        let encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
        view.rgb.write_with_encoder(encoder).map_err(io::Error::other)?;
        let mono_ns = FRAME_NS * (1 + seq as u64);
        let wall = jiff::Timestamp::new(START_SECONDS, 0)
            .and_then(|start| start.checked_add(std::time::Duration::from_nanos(mono_ns)))
            .map_err(io::Error::other)?;
        Ok(Frame {
            camera: self.camera.clone(),
            seq: seq as u64,
            stamp: Stamp { mono_ns, wall: wall.to_string(), boot_id: self.boot_id.clone() },
            format: PixelFormat::Jpeg,
            width: self.intrinsics.width,
            height: self.intrinsics.height,
            stride: 0,
            bytes: bytes.into(),
            world_from_camera: Some(self.poses[seq]),
        })
    }
}

impl Source for Synthetic {
    fn next(&mut self) -> Result<Option<Frame>, SourceError> {
        if self.next == self.poses.len() {
            return Ok(None);
        }
        let seq = self.next;
        self.next += 1;
        let lost = |source| SourceError::Lost { what: "the synthetic camera".into(), source };
        self.frame(seq).map(Some).map_err(lost)
    }

    fn len_hint(&self) -> Option<u64> {
        Some((self.poses.len() - self.next) as u64)
    }
}
