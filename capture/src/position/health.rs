use std::collections::BTreeMap;

use serde::Serialize;

use super::Fix;

/// What the receiver is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PositionState {
    /// It has not said anything yet.
    #[default]
    Starting,
    /// Fixes come.
    Fix,
    /// It talks and has none.
    NoFix,
    /// It is not there; it is opened again.
    Lost,
}

/// How the receiver does.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PositionHealth {
    /// Where it is read.
    pub receiver: String,
    /// What it is doing.
    pub state: PositionState,
    /// Fixes taken.
    pub fixes: u64,
    /// Whole sentences or reports, with a fix or without.
    pub sentences: u64,
    /// What was of no use, by its reason ([`Fault`](super::Fault)).
    pub faults: BTreeMap<&'static str, u64>,
    /// The last fix.
    pub last: Option<Fix>,
    /// Seconds since then.
    pub last_fix_age: Option<f64>,
    /// What was last wrong with the line to it.
    pub last_error: Option<String>,
}
