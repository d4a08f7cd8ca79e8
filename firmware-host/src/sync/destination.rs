use std::path::PathBuf;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use futures_util::StreamExt;
use object_store::aws::AmazonS3Builder;
use object_store::http::HttpBuilder;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{ClientOptions, ObjectStore, ObjectStoreExt, RetryConfig};
use reqwest::Url;
use reqwest::header::HeaderValue;

use super::secret::Secret;
use super::wire::Wire;
use crate::config::SyncConfig;
use crate::error::{CommandError, Exit, chain};

/// Why there is no destination.
#[derive(Debug, thiserror::Error)]
pub enum SyncError {
    /// A key of the configuration.
    #[error("configuration: `sync.{key}`: expected {expected}, found {found}")]
    Config {
        /// The key.
        key: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A file with other content than it should have; secrets are not quoted.
    #[error("{path}: expected {expected}, found {found}")]
    File {
        /// The file.
        path: PathBuf,
        /// What it must hold.
        expected: &'static str,
        /// What it holds.
        found: String,
    },
    /// A file that cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's own error.
        source: std::io::Error,
    },
    /// The client cannot be made.
    #[error("sync: {message}")]
    Client {
        /// Why.
        message: String,
    },
    /// Another program syncs this store just now.
    #[error("{path}: expected no other sync of this store, found one at work")]
    Locked {
        /// The lock.
        path: PathBuf,
    },
}

impl From<SyncError> for CommandError {
    fn from(error: SyncError) -> Self {
        match &error {
            SyncError::Config { expected, found, .. } | SyncError::File { expected, found, .. } => {
                Self::usage("configuration", &error).with(expected, found)
            }
            SyncError::Io { .. } => Self::usage("configuration", chain(&error)),
            SyncError::Client { .. } => Self::failed("sync", &error),
            SyncError::Locked { .. } => Self { exit: Exit::Failed, ..Self::failed("sync_running", &error) },
        }
    }
}

/// Why an object is not there.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The way, the server or its answer: what comes next would fare no better.
    #[error("{doing}: {message}")]
    Server {
        /// `put` or `get`.
        doing: &'static str,
        /// What went wrong.
        message: String,
    },
    /// The server took the object and gave something else back.
    #[error("{key}: expected to read back what was sent, found {found}")]
    Differs {
        /// The object.
        key: String,
        /// What came back.
        found: String,
    },
}

/// Where plants go.
#[derive(Debug)]
pub struct Destination {
    name: String,
    prefix: Path,
    store: Box<dyn ObjectStore>,
    /// What goes to the server as a token: a server may quote it back at us.
    token: Option<Secret>,
}

/// Longest message kept, characters: a guess that holds what an S3 server says.
const MAX_MESSAGE: usize = 400;

impl Destination {
    /// Makes the destination that the configuration names; nothing is sent yet. `None` where it names none.
    ///
    /// # Errors
    /// [`SyncError`] naming the key or the file.
    pub fn open(config: &SyncConfig) -> Result<Option<Self>, SyncError> {
        let Some(text) = &config.url else { return Ok(None) };
        let wrong = |found: String| SyncError::Config {
            key: "url",
            expected: "s3://BUCKET/PREFIX, https://HOST/PATH or file:///FOLDER, without user, password or query",
            found,
        };
        let url = Url::parse(text).map_err(|error| wrong(error.to_string()))?;
        if url.password().is_some() || !url.username().is_empty() {
            // A password in the url must not be printed.
            return Err(wrong("a user in the url".into()));
        }
        if url.query().is_some() || url.fragment().is_some() {
            return Err(wrong(format!("`{text}`")));
        }
        let path = |path: &str| Path::parse(path.trim_matches('/')).map_err(|error| wrong(error.to_string()));
        let name = config.endpoint.as_ref().map_or_else(|| text.clone(), |endpoint| format!("{text} at {endpoint}"));
        let at = |prefix, store| Self { name, prefix, store, token: None };
        Ok(Some(match url.scheme() {
            "s3" => at(path(url.path())?, bucket(config, url.host_str().unwrap_or_default())?),
            "http" | "https" => {
                let token = token(config)?;
                Self { token: token.clone(), ..at(Path::default(), server(config, &url, token)?) }
            }
            "file" => at(Path::default(), disk(&url)?),
            _ => return Err(wrong(format!("`{text}`"))),
        }))
    }

    /// Its url and endpoint, which hold no secret.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Stores `bytes` under `key` and reads them back.
    ///
    /// # Errors
    /// [`SendError`] unless exactly these bytes came back.
    pub async fn send(&self, key: &str, bytes: &[u8]) -> Result<(), SendError> {
        let failed = |doing| move |error| SendError::Server { doing, message: self.message(&error) };
        let differs = |found| SendError::Differs { key: key.to_owned(), found };
        let path = self.prefix.parts().chain(Path::parse(key).iter().flat_map(Path::parts)).collect();
        self.store.put(&path, bytes.to_vec().into()).await.map_err(failed("put"))?;
        let back = match self.store.get(&path).await {
            Err(object_store::Error::NotFound { .. }) => return Err(differs("nothing".into())),
            back => back.map_err(failed("get"))?,
        };
        if back.meta.size != bytes.len() as u64 {
            return Err(differs(format!("{} bytes in place of {}", back.meta.size, bytes.len())));
        }
        let (mut stream, mut hasher, mut read) = (back.into_stream(), blake3::Hasher::new(), 0);
        while let Some(chunk) = stream.next().await {
            let chunk = chunk.map_err(failed("get"))?;
            read += chunk.len();
            // A server that goes on after what it announced is not listened to.
            if read > bytes.len() {
                return Err(differs(format!("more than {} bytes", bytes.len())));
            }
            hasher.update(&chunk);
        }
        let found = hasher.finalize();
        if found == blake3::hash(bytes) { Ok(()) } else { Err(differs(format!("bytes of BLAKE3 {found}"))) }
    }
}

impl Destination {
    /// What went wrong, short and without the token.
    fn message(&self, error: &object_store::Error) -> String {
        let text = chain(error);
        let text = self.token.iter().fold(text, |text, token| text.replace(token.reveal(), "(secret)"));
        let plain = text.chars().map(|c| if c.is_control() { ' ' } else { c });
        plain.take(MAX_MESSAGE).collect::<String>().trim_end().to_owned()
    }
}

/// A failed request is not repeated at once: [`super::Backoff`] says when the next one may be.
fn once() -> RetryConfig {
    RetryConfig { max_retries: 0, ..RetryConfig::default() }
}

fn bucket(config: &SyncConfig, bucket: &str) -> Result<Box<dyn ObjectStore>, SyncError> {
    let missing = |key, expected| SyncError::Config { key, expected, found: "nothing".into() };
    let user = config.user.as_ref().ok_or_else(|| missing("user", "the access key id"))?;
    let secret = Secret::load(config)?;
    let secret = secret.ok_or_else(|| missing("credential", "a systemd credential of that name, or `secret_file`"))?;
    let mut builder = AmazonS3Builder::new()
        .with_bucket_name(bucket)
        .with_region(&config.region)
        .with_access_key_id(user)
        .with_secret_access_key(secret.reveal())
        .with_retry(once())
        .with_http_connector(Wire::new(config.ca_file.as_deref(), None)?);
    if let Some(endpoint) = &config.endpoint {
        let url = Url::parse(endpoint).ok();
        let url = url.filter(|url| matches!(url.scheme(), "http" | "https") && url.username().is_empty());
        let wrong = || SyncError::Config { key: "endpoint", expected: "https://HOST:PORT", found: endpoint.clone() };
        let url = url.ok_or_else(wrong)?;
        encrypted("endpoint", &url)?;
        builder = builder.with_endpoint(endpoint).with_allow_http(url.scheme() == "http");
    }
    let store = builder.build().map_err(|error| SyncError::Client { message: chain(&error) })?;
    Ok(Box::new(store))
}

/// What an HTTP server wants to see: the secret itself, or user and secret in base64.
fn token(config: &SyncConfig) -> Result<Option<Secret>, SyncError> {
    let secret = Secret::load(config)?;
    Ok(secret.map(|secret| match &config.user {
        Some(user) => Secret::new(BASE64_STANDARD.encode(format!("{user}:{}", secret.reveal()))),
        None => secret,
    }))
}

fn server(config: &SyncConfig, url: &Url, token: Option<Secret>) -> Result<Box<dyn ObjectStore>, SyncError> {
    encrypted("url", url)?;
    let scheme = if config.user.is_some() { "Basic" } else { "Bearer" };
    let header = token.map(|token| HeaderValue::from_str(&format!("{scheme} {}", token.reveal()))).transpose();
    let mut header = header.map_err(|error| SyncError::Client { message: error.to_string() })?;
    if let Some(header) = &mut header {
        header.set_sensitive(true);
    }
    let wire = Wire::new(config.ca_file.as_deref(), header)?;
    let options = ClientOptions::new().with_allow_http(url.scheme() == "http");
    let builder = HttpBuilder::new().with_url(url.as_str()).with_client_options(options);
    let store = builder.with_retry(once()).with_http_connector(wire).build();
    Ok(Box::new(store.map_err(|error| SyncError::Client { message: chain(&error) })?))
}

/// Without TLS only this machine itself is spoken to.
fn encrypted(key: &'static str, url: &Url) -> Result<(), SyncError> {
    let host = url.host_str().unwrap_or_default();
    let loopback =
        host == "localhost" || host.trim_matches(['[', ']']).parse().is_ok_and(|ip: std::net::IpAddr| ip.is_loopback());
    if url.scheme() == "https" || loopback {
        return Ok(());
    }
    Err(SyncError::Config { key, expected: "https, except on this machine", found: url.to_string() })
}

/// The folder must be there: made by us, it would fill the box's own disk whenever the other is not mounted.
fn disk(url: &Url) -> Result<Box<dyn ObjectStore>, SyncError> {
    let folder = url.to_file_path().ok().filter(|folder| folder.is_dir());
    let wrong = || SyncError::Config {
        key: "url",
        expected: "a folder that exists, made by hand on the mounted disk",
        found: url.to_string(),
    };
    let store = LocalFileSystem::new_with_prefix(folder.ok_or_else(wrong)?);
    Ok(Box::new(store.map_err(|error| SyncError::Client { message: chain(&error) })?.with_fsync(true)))
}
