use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde_json::json;

use crate::error::chain;
use crate::store::StoreError;

/// An error as JSON: the same object as the command line's, with a status.
#[derive(Debug)]
pub(super) struct ApiError {
    status: StatusCode,
    kind: &'static str,
    message: String,
}

impl ApiError {
    pub(super) fn not_found(message: &str) -> Self {
        Self { status: StatusCode::NOT_FOUND, kind: "not_found", message: message.into() }
    }

    pub(super) fn method() -> Self {
        Self { status: StatusCode::METHOD_NOT_ALLOWED, kind: "method", message: "another method was expected".into() }
    }

    pub(super) fn bad_request(message: impl ToString) -> Self {
        Self { status: StatusCode::BAD_REQUEST, kind: "bad_request", message: message.to_string() }
    }

    pub(super) fn forbidden(message: &str) -> Self {
        Self { status: StatusCode::FORBIDDEN, kind: "forbidden", message: message.into() }
    }

    pub(super) fn busy() -> Self {
        let message = "another one is being made; ask again in a second".into();
        Self { status: StatusCode::SERVICE_UNAVAILABLE, kind: "busy", message }
    }

    /// Something of ours broke: the log has the reason, the client none of our paths.
    pub(super) fn internal(error: &dyn std::error::Error) -> Self {
        tracing::error!("request failed: {}", chain(error));
        let message = "the store could not be read; the log says why".into();
        Self { status: StatusCode::INTERNAL_SERVER_ERROR, kind: "store", message }
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        Self::internal(&error)
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let error = json!({"error": {"kind": self.kind, "message": self.message}});
        (self.status, Json(error)).into_response()
    }
}
