//! Cameras that stay: whatever happens to one, it is opened again, and the others go on.
//!
//! ```text
//! Driver ─► Stream ─► Supervisor (a thread a camera) ─► Board: a short queue and the health of each ─► Cameras: Source
//! ```

mod board;
mod cameras;
pub(crate) mod driver;
mod fault;
mod health;
mod sequence;
mod settings;
mod supervisor;
#[cfg(test)]
mod tests;

pub use cameras::{Cameras, CamerasHealth};
pub(crate) use cameras::{boot_id, monotonic_ns};
pub use fault::CameraFault;
pub use health::{CameraHealth, CameraState};
pub use settings::{Backend, CameraSettings, Controls, Mode, Mount, Speed, longest_exposure, sampling};
