//! What the daemon says about itself, on the page, through the API and by the lamp.

use demeter_capture::{CameraHealth, PositionHealth};
use serde::Serialize;

use crate::daemon::disk::Room;
use crate::daemon::thermal::Heat;

/// All of it, as the event loop saw it last.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Status {
    /// The box.
    pub rig: String,
    /// What it does.
    pub activity: Activity,
    /// Whether it works.
    pub health: Health,
    /// Why it does not, worst first; empty when it works.
    pub reasons: Vec<Reason>,
    /// The pipeline's stages; empty while none runs.
    pub stages: Vec<Stage>,
    /// The rig's cameras; empty while nothing gives frames.
    pub cameras: Vec<CameraStatus>,
    /// The satellite receiver; none where there is none.
    pub position: Option<PositionHealth>,
    /// Live frames dropped since the source started, because the box was busy.
    pub frames_dropped: u64,
    /// The wall clock is set by something that knows the time.
    pub time_trusted: bool,
    /// Temperature and what follows from it.
    pub heat: Heat,
    /// Room on the disk and what follows from it.
    pub disk: Room,
}

/// The lamp's three patterns and the page's three colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Health {
    /// Nothing is lost.
    #[default]
    Works,
    /// It goes on, with less than it should have.
    Degraded,
    /// No plants are made or kept.
    Broken,
}

/// One thing that is not as it should be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reason {
    /// What it does to the health of the whole.
    pub health: Health,
    /// A stable word for programs, such as `storage_full`.
    pub kind: &'static str,
    /// One line for people.
    pub message: String,
}

/// What the program does.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "state", content = "message", rename_all = "snake_case")]
pub enum Activity {
    /// No source of frames is configured: stored plants are shown.
    #[default]
    Idle,
    /// Frames become plants.
    Working,
    /// The source came to its end.
    Finished,
    /// The pipeline stopped for this reason.
    Failed(String),
}

/// One camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraStatus {
    /// How it does.
    #[serde(flatten)]
    pub health: CameraHealth,
    /// What is wrong with its lens, one line; none as far as its pictures tell.
    pub lens: Option<String>,
}

/// One stage of the pipeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// `reader`, `looker` or `keeper`.
    pub name: &'static str,
    /// How long the item in hand has taken, seconds; none while the stage waits for work.
    pub busy_seconds: Option<f64>,
    /// It has taken too long to be alive.
    pub stuck: bool,
}
