use axum::Json;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{Path, Query, State};
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::IntoResponse;
use serde::Deserialize;

use super::Api;
use super::reply::ApiError;
use crate::mesh_file::MeshFormat;
use crate::report::Document;
use crate::store::Page;

/// Plants on a page when the request names no limit.
const LIMIT: u32 = 50;

pub(super) type Id = Result<Path<String>, PathRejection>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct List {
    cursor: Option<i64>,
    limit: Option<u32>,
}

/// GET /api/v1/plants: a page of the list, newest first; `next` is the cursor of the following page.
pub(super) async fn list(
    State(api): State<Api>,
    list: Result<Query<List>, QueryRejection>,
) -> Result<Json<Page>, ApiError> {
    let Query(list) = list.map_err(|error| ApiError::bad_request(error.body_text()))?;
    Ok(Json(api.read(move |reader| reader.page(list.cursor, list.limit.unwrap_or(LIMIT))).await?))
}

/// GET /api/v1/plants/{id}: the document of plant.schema.json.
pub(super) async fn show(State(api): State<Api>, id: Id) -> Result<Json<Document>, ApiError> {
    let id = known(id)?;
    let plant = api.read(move |reader| reader.plant(&id)).await?.ok_or_else(unknown)?;
    Ok(Json(Document { plants: vec![plant], ..Document::default() }))
}

/// GET /api/v1/plants/{id}/mesh.glb: the plant decoded from its record, y up as glTF wants it.
pub(super) async fn mesh(State(api): State<Api>, id: Id) -> Result<impl IntoResponse, ApiError> {
    let id = known(id)?;
    let stored = api.read(move |reader| reader.record(&id)).await?.ok_or_else(unknown)?;
    // Decoding and meshing take milliseconds of a processor: not on the threads that answer everybody.
    let glb = tokio::task::spawn_blocking(move || MeshFormat::Glb.encode_stored(&stored)).await;
    let glb = glb.map_err(|panic| ApiError::internal(&panic))?.map_err(|error| ApiError::internal(&error))?;
    Ok(([(CONTENT_TYPE, "model/gltf-binary")], glb))
}

/// GET /api/v1/plants/{id}/record: the compact record.
pub(super) async fn record(State(api): State<Api>, id: Id) -> Result<impl IntoResponse, ApiError> {
    let id = known(id)?;
    let stored = api.read(move |reader| reader.record(&id)).await?.ok_or_else(unknown)?;
    let headers =
        [(CONTENT_TYPE, "application/octet-stream"), (CONTENT_DISPOSITION, "attachment; filename=\"plant.dmtr\"")];
    Ok((headers, stored.record))
}

/// GET /api/v1/plants/{id}/thumbnail: the photo's crop beside the fitted plant.
pub(super) async fn thumbnail(State(api): State<Api>, id: Id) -> Result<impl IntoResponse, ApiError> {
    let id = known(id)?;
    let png = api.read(move |reader| reader.thumbnail(&id)).await?;
    Ok(([(CONTENT_TYPE, "image/png")], png.ok_or_else(|| ApiError::not_found("no such picture"))?))
}

pub(super) fn known(id: Id) -> Result<String, ApiError> {
    id.map(|Path(id)| id).map_err(|error| ApiError::bad_request(error.body_text()))
}

fn unknown() -> ApiError {
    ApiError::not_found("no such plant")
}
