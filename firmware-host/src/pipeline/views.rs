use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use demeter_capture::{CameraHealth, CameraState};
use demeter_frame::{CameraId, Frame};

/// The last frame of each camera that passed the gate, for whoever wants to look; cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Views(Arc<Mutex<BTreeMap<CameraId, View>>>);

#[derive(Debug)]
struct View {
    /// As the camera gave it: nobody decodes it for nothing.
    frame: Frame,
    frames: u64,
    at: Instant,
}

impl Views {
    /// Takes a frame that passed the gate.
    pub fn show(&self, frame: &Frame) {
        let mut views = self.views();
        let frames = views.get(&frame.camera).map_or(0, |view| view.frames) + 1;
        views.insert(frame.camera.clone(), View { frame: frame.clone(), frames, at: Instant::now() });
    }

    /// The camera's last frame, where it has given any.
    #[must_use]
    pub fn last(&self, camera: &CameraId) -> Option<Frame> {
        self.views().get(camera).map(|view| view.frame.clone())
    }

    /// Forgets every frame: another source begins.
    pub fn clear(&self) {
        self.views().clear();
    }

    /// The cameras of a source that has none that could fail: they are known by their frames alone.
    pub(super) fn cameras(&self) -> Vec<CameraHealth> {
        let health = |(id, view): (&CameraId, &View)| CameraHealth {
            frames: view.frames,
            state: CameraState::Streaming,
            last_frame_age: Some(view.at.elapsed().as_secs_f64()),
            ..CameraHealth::new(id.clone(), "none: frames come from a recording or are made up")
        };
        self.views().iter().map(health).collect()
    }

    fn views(&self) -> MutexGuard<'_, BTreeMap<CameraId, View>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
