use std::net::SocketAddr;
use std::time::Duration;

use reqwest::{RequestBuilder, StatusCode};
use rustls::RootCertStore;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::attend::Report;
use super::wire::{MAX_REPLY, builder};
use crate::api::SyncStatus;
use crate::error::CommandError;

/// How often the daemon is asked whether it is done.
const EVERY: Duration = Duration::from_millis(500);
/// Longest wait for an answer: it comes from this machine.
const ANSWER: Duration = Duration::from_secs(10);

#[derive(Deserialize)]
struct Asked {
    asked: u64,
}

/// Asks the daemon at `address` for a pass and waits until it is over. `None` where nobody listens.
///
/// # Errors
/// [`CommandError`] `daemon` when what listens there does not answer as the daemon does.
pub async fn ask(address: SocketAddr) -> Result<Option<Report>, CommandError> {
    let wrong = |found: &dyn std::fmt::Display| CommandError {
        message: format!("{address}: expected the daemon, found {found}"),
        ..CommandError::usage("daemon", "")
    };
    // On this machine nothing is encrypted, so no authority is needed.
    let client = builder(RootCertStore::empty())?.timeout(ANSWER).build();
    let client = client.map_err(|error| wrong(&error))?;
    let url = format!("http://{address}/api/v1/sync");
    let asked: Asked = match answer(client.post(format!("{url}/run"))).await {
        Err(Unanswered::Nobody) => return Ok(None),
        asked => asked.map_err(|error| wrong(&error))?,
    };
    loop {
        let SyncStatus { report, .. } = answer(client.get(&url)).await.map_err(|error| wrong(&error))?;
        if report.ended >= asked.asked {
            return Ok(Some(report));
        }
        tokio::time::sleep(EVERY).await;
    }
}

#[derive(Debug, thiserror::Error)]
enum Unanswered {
    #[error("nobody")]
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

async fn answer<T: DeserializeOwned>(request: RequestBuilder) -> Result<T, Unanswered> {
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
