//! Frames from cameras and recordings, decoded strictly and gated with reasons.
//!
//! ```text
//! Source::next ──► Frame ──► Gate::admit ──► Rgb ──► (models)
//!      │                         │
//!      └─ SourceError::Frame     └─ Refusal
//!              └──── Reason ◄────────┘   one counter each, in Counts
//! ```
//!
//! Start at [`Source`]: whatever gives frames is one. [`Cameras`] gives those of the rig's cameras, opened again whatever
//! happens to them; [`Replay`] gives those of a recorded session, [`Recorder`] writes such a session, and [`Manifest`] is its `session.toml`. [`Gate::admit`] puts a frame in order, decodes it ([`decode`])
//! and looks at exposure, sharpness and, over time, the lens ([`LensWatch`]). A frame that is no good ends in exactly one [`Reason`] and the run goes on; only
//! a broken recording as a whole ([`SessionError`]) or a source that is gone ([`SourceError::Lost`]) stops it.
//!
//! [`parse_calibration`] reads what other programs know of a camera's lens.
//!
//! A [`Receiver`] gives [`Positions`]: where the rig was at the time of a frame.
//!
//! Spec: appliance.md "Data path", "Cameras", "A recorded session"; reliability.md 23 and 24. The crate knows no network,
//! plant or store.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod calibration;
mod camera;
mod counts;
mod gate;
mod lens;
mod libcamera;
#[cfg(feature = "nokhwa")]
mod nokhwa;
mod order;
mod pixels;
mod position;
mod session;
mod source;
mod v4l2;

pub use calibration::{CalibrationError, camera_info, parse_calibration};
pub use camera::{
    Backend, CameraFault, CameraHealth, CameraSettings, CameraState, Cameras, CamerasHealth, Controls, Mode, Mount,
    Speed, longest_exposure, sampling,
};
pub use counts::{Counts, Reason};
pub use gate::{Gate, GateConfig, Refusal, Verdict};
pub use lens::{Lens, LensWatch};
pub use pixels::{DecodeError, MAX_PIXELS, decode, decode_photo};
pub use position::{
    Fault, Fix, PositionHealth, PositionState, Positions, Quality, Receiver, ReceiverSettings, ReceiverSource,
};
pub use session::{
    FileFault, FrameError, FrameFault, ID, LONGEST_ARM, MAX_FRAME_BYTES, Manifest, ManifestError, Pace, Recorder,
    Replay, Row, SCHEMA_VERSION, SessionCamera, SessionError, is_id,
};
pub use source::{CameraError, Source, SourceError};
pub use v4l2::{Device, OfferedMode, devices};
