use std::net::SocketAddr;
use std::time::Duration;

use rustls::RootCertStore;
use serde::Deserialize;

use super::answer::{Unanswered, answer};
use super::attend::Report;
use super::wire::builder;
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
