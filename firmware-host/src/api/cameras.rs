//! The rig's cameras and what they see.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use demeter_capture::decode;
use demeter_frame::{CameraId, Frame};
use image::ImageError;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::thumbnail;
use serde::Serialize;

use super::Api;
use super::plants::{Id, known};
use super::reply::ApiError;
use crate::status::CameraStatus;

/// How long a preview is as good as new: however many ask, a camera's frame is encoded once in this time.
const FRESH: Duration = Duration::from_secs(1);

/// Width of a preview, pixels, and its quality from 1 to 100: enough to see where the camera looks, about 40 KB.
const WIDTH: u32 = 640;
const QUALITY: u8 = 70;

/// The answer of [`list`].
#[derive(Debug, Serialize)]
pub(super) struct List {
    cameras: Vec<CameraStatus>,
}

/// GET /api/v1/cameras: how each of them does.
pub(super) async fn list(State(api): State<Api>) -> Json<List> {
    Json(List { cameras: api.inner.status.borrow().cameras.clone() })
}

/// The previews that were made last. One is made at a time: who comes meanwhile gets the one before, or is told to come
/// back, and never waits in a queue.
#[derive(Debug, Default)]
pub(super) struct Previews {
    made: Mutex<BTreeMap<CameraId, (Instant, Bytes)>>,
    making: Arc<tokio::sync::Mutex<()>>,
}

impl Previews {
    fn last(&self, camera: &CameraId) -> Option<(Instant, Bytes)> {
        self.made.lock().unwrap_or_else(PoisonError::into_inner).get(camera).cloned()
    }

    fn keep(&self, camera: CameraId, jpeg: Bytes) {
        self.made.lock().unwrap_or_else(PoisonError::into_inner).insert(camera, (Instant::now(), jpeg));
    }
}

/// GET /api/v1/cameras/{id}/preview.jpg: the last frame that passed the gate, made smaller.
pub(super) async fn preview(State(api): State<Api>, id: Id) -> Result<impl IntoResponse, ApiError> {
    let camera = CameraId(known(id)?);
    let none = || ApiError::not_found("no such camera, or no good frame from it yet");
    let frame = api.inner.views.last(&camera).ok_or_else(none)?;
    Ok(([(CONTENT_TYPE, "image/jpeg")], picture(&api, camera, frame).await?))
}

async fn picture(api: &Api, camera: CameraId, frame: Frame) -> Result<Bytes, ApiError> {
    let last = api.inner.previews.last(&camera);
    if let Some((at, jpeg)) = &last
        && at.elapsed() < FRESH
    {
        return Ok(jpeg.clone());
    }
    let Ok(making) = api.inner.previews.making.clone().try_lock_owned() else {
        return last.map(|(_, jpeg)| jpeg).ok_or_else(ApiError::busy);
    };
    let inner = api.inner.clone();
    let make = move || {
        let jpeg = encode(&frame);
        if let Ok(jpeg) = &jpeg {
            inner.previews.keep(camera, jpeg.clone());
        }
        // Held until here, even where the client has gone away meanwhile.
        drop(making);
        jpeg
    };
    let made = tokio::task::spawn_blocking(make).await.map_err(|panic| ApiError::internal(&panic))?;
    made.map_err(|error| ApiError::internal(&error))
}

fn encode(frame: &Frame) -> Result<Bytes, ImageError> {
    let whole = decode(frame).map_err(|error| ImageError::IoError(std::io::Error::other(error)))?;
    let width = whole.width().min(WIDTH);
    let height = (u64::from(whole.height()) * u64::from(width) / u64::from(whole.width().max(1))).max(1) as u32;
    let mut jpeg = Cursor::new(Vec::new());
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY).encode_image(&thumbnail(&whole, width, height))?;
    Ok(jpeg.into_inner().into())
}
