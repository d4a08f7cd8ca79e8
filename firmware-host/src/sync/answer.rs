use reqwest::{RequestBuilder, StatusCode};
use serde::de::DeserializeOwned;

use super::wire::MAX_REPLY;

/// Why there is no answer in JSON. What a server said is not quoted: it may quote our token.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unanswered {
    #[error("no connection")]
    Nobody,
    #[error("{0}")]
    Http(#[from] reqwest::Error),
    #[error("status {0}")]
    Status(StatusCode),
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    #[error("an answer of more than {MAX_REPLY} bytes")]
    TooLong,
}

/// Sends a request and reads its answer.
pub(super) async fn answer<T: DeserializeOwned>(request: RequestBuilder) -> Result<T, Unanswered> {
    let sent = request.send().await;
    let mut response = sent.map_err(|error| if error.is_connect() { Unanswered::Nobody } else { error.into() })?;
    if !response.status().is_success() {
        return Err(Unanswered::Status(response.status()));
    }
    let mut body = Vec::new();
    while let Some(chunk) = response.chunk().await? {
        body.extend_from_slice(&chunk);
        if body.len() > MAX_REPLY {
            return Err(Unanswered::TooLong);
        }
    }
    Ok(serde_json::from_slice(&body)?)
}
