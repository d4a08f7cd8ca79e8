use std::path::PathBuf;

use serde::Deserialize;

use super::BrapiConfig;

/// `[sync]`: where plants go at night (docs/sync.md). Without a `url` they stay on the box.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SyncConfig {
    /// `s3://BUCKET/PREFIX`, `https://HOST/PATH` (WebDAV, or any server that takes PUT and GET), or `file:///FOLDER` of
    /// a mounted disk.
    pub url: Option<String>,
    /// The server of an `s3` url, such as `https://depot.example:3900`; Amazon's own when absent.
    pub endpoint: Option<String>,
    /// The region of an `s3` url.
    pub region: String,
    /// The access key id of an `s3` url, or the user of an `https` url; the latter sends its secret as a bearer token
    /// when no user is named.
    pub user: Option<String>,
    /// The systemd credential that holds the secret.
    pub credential: String,
    /// A file of mode 0600 that holds the secret, in place of the credential.
    pub secret_file: Option<PathBuf>,
    /// Certificates (PEM) that alone are trusted to vouch for the server, in place of the system's.
    pub ca_file: Option<PathBuf>,
    /// The clock is right although systemd does not say so, as in a container. Certificates are verified all the same.
    pub trust_clock: bool,
    /// A breeding database that takes the plants' traits, too.
    pub brapi: Option<BrapiConfig>,
}

impl Default for SyncConfig {
    fn default() -> Self {
        Self {
            url: None,
            endpoint: None,
            region: "us-east-1".into(),
            user: None,
            credential: "demeter-sync".into(),
            secret_file: None,
            ca_file: None,
            trust_clock: false,
            brapi: None,
        }
    }
}
