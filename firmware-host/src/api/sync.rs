use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::Api;
use super::reply::ApiError;
use crate::store::Outbox;
use crate::sync::Report;

/// Plants named in an answer: these with their reasons stay below the 64 KiB that our own client reads.
const NAMED: u32 = 100;
const NAMED_UNITS: u32 = 20;

/// GET /api/v1/sync: how the sync stands, what waits and why.
#[derive(Debug, Serialize, Deserialize)]
pub struct SyncStatus {
    /// What the daemon's sync does.
    pub report: Report,
    /// What waits, the oldest plants by name.
    pub outbox: Outbox,
    /// What waits for the BrAPI server, where there is one.
    pub brapi: Option<Outbox>,
}

pub(super) async fn show(State(api): State<Api>) -> Result<Json<SyncStatus>, ApiError> {
    let attendant = &api.inner.attendant;
    let outbox = api.read(|reader| reader.outbox(NAMED)).await?;
    let brapi = match attendant.brapi() {
        Some(name) => Some(api.read(move |reader| reader.units(&name, NAMED_UNITS)).await?),
        None => None,
    };
    Ok(Json(SyncStatus { report: attendant.report(), outbox, brapi }))
}

/// POST /api/v1/sync/run: asks for a pass; `asked` is its number, which `report.ended` reaches when it is over.
pub(super) async fn run(State(api): State<Api>) -> (StatusCode, Json<Value>) {
    (StatusCode::ACCEPTED, Json(json!({"asked": api.inner.attendant.ask()})))
}
