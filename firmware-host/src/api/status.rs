use axum::Json;
use axum::extract::State as Extract;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use serde::Serialize;

use super::Api;
use super::reply::ApiError;
use crate::status::Status;
use crate::store::{Reader, Summary};

/// The answer of [`status`].
#[derive(Debug, Serialize)]
pub(super) struct Answer {
    version: &'static str,
    #[serde(flatten)]
    status: Status,
    store: Summary,
}

/// GET /healthz: the program runs and its store answers.
pub(super) async fn healthz(Extract(api): Extract<Api>) -> Result<&'static str, ApiError> {
    api.read(Reader::summary).await?;
    Ok("ok\n")
}

/// GET /api/v1/status: what it does, how it is and what it has.
pub(super) async fn status(Extract(api): Extract<Api>) -> Result<Json<Answer>, ApiError> {
    let store = api.read(Reader::summary).await?;
    let status = api.inner.status.borrow().clone();
    Ok(Json(Answer { version: env!("CARGO_PKG_VERSION"), status, store }))
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
