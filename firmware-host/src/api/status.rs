use std::sync::{Arc, Mutex, PoisonError};

use axum::Json;
use axum::extract::State as Extract;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use serde::Serialize;
use serde_json::{Value, json};

use super::Api;
use super::reply::ApiError;
use crate::store::Reader;

/// What the program is doing, set by `run` and shown by the page; cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Activity {
    state: Arc<Mutex<State>>,
}

/// The three colours of the page, and why.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "state", content = "message", rename_all = "snake_case")]
pub enum State {
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

impl Activity {
    /// Says what the program does now.
    pub fn set(&self, state: State) {
        *self.state.lock().unwrap_or_else(PoisonError::into_inner) = state;
    }

    /// What the program does now.
    #[must_use]
    pub fn get(&self) -> State {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// GET /healthz: the program runs and its store answers.
pub(super) async fn healthz(Extract(api): Extract<Api>) -> Result<&'static str, ApiError> {
    api.read(Reader::summary).await?;
    Ok("ok\n")
}

/// GET /api/v1/status: what it does and what it has.
pub(super) async fn status(Extract(api): Extract<Api>) -> Result<Json<Value>, ApiError> {
    let summary = api.read(Reader::summary).await?;
    let activity = api.inner.activity.get();
    Ok(Json(json!({"version": env!("CARGO_PKG_VERSION"), "activity": activity, "store": summary})))
}

/// GET /metrics: Prometheus' text format.
pub(super) async fn metrics(Extract(api): Extract<Api>) -> Result<impl IntoResponse, ApiError> {
    let summary = api.read(Reader::summary).await?;
    metrics::with_local_recorder(&*api.inner.recorder, || {
        metrics::gauge!("demeter_plants").set(summary.plants as f64);
        metrics::gauge!("demeter_plants_unsent").set(summary.unsent as f64);
    });
    Ok(([(CONTENT_TYPE, "text/plain; version=0.0.4")], api.inner.metrics.render()))
}
