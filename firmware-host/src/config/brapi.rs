use std::path::PathBuf;

use serde::Deserialize;

/// `[sync.brapi]`: a breeding database that takes each plant as an observation unit (docs/sync.md).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BrapiConfig {
    /// The root of its API, such as `https://breeding.example/brapi/v2`.
    pub url: String,
    /// Its id of the study that the plants belong to.
    pub study: String,
    /// Its id of what is sown.
    pub germplasm: Option<String>,
    /// The systemd credential that holds the bearer token.
    #[serde(default = "credential")]
    pub credential: String,
    /// A file of mode 0600 that holds the token, in place of the credential.
    pub secret_file: Option<PathBuf>,
    /// Certificates (PEM) that alone are trusted to vouch for the server, in place of the system's.
    pub ca_file: Option<PathBuf>,
}

impl BrapiConfig {
    /// What the store knows the server by: where plants go twice, they go to two of these.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{} study {}", self.url, self.study)
    }
}

fn credential() -> String {
    "demeter-brapi".into()
}
