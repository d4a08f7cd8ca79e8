use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use futures_util::{StreamExt, TryStreamExt};
use object_store::aws::AmazonS3Builder;
use object_store::http::HttpBuilder;
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{ClientOptions, ObjectStore, ObjectStoreExt, RetryConfig};
use reqwest::Url;

use super::error::{SendError, SyncError};
use super::secret::{Secret, authorization};
use super::wire::{MAX_OBJECT, Wire, encrypted};
use crate::config::SyncConfig;
use crate::error::chain;
use crate::tables::hash;

/// Where plants go.
#[derive(Debug)]
pub struct Destination {
    name: String,
    prefix: Path,
    store: Box<dyn ObjectStore>,
    /// What goes to the server as a token: a server may quote it back at us.
    token: Option<Secret>,
}

/// What lies at a destination.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Object {
    /// Its key below the destination.
    pub key: String,
    /// Bytes.
    pub size: u64,
}

/// Most objects that a listing may have: a guess at some years of a large fleet.
const MAX_LISTED: usize = 1_000_000;

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
        let at = |prefix, store| Self { prefix, ..Self::over(name, store) };
        Ok(Some(match url.scheme() {
            "s3" => at(path(url.path())?, bucket(config, url.host_str().unwrap_or_default())?),
            "http" | "https" => {
                let token = token(config)?;
                // Lists name objects from the server's root on, so that is where its store begins.
                let prefix = Path::from_url_path(url.path()).map_err(|error| wrong(error.to_string()))?;
                let store = server(config, &url, token.clone())?;
                Self { token, ..at(prefix, store) }
            }
            "file" => at(Path::default(), disk(&url)?),
            _ => return Err(wrong(format!("`{text}`"))),
        }))
    }

    /// A destination at the root of that store.
    #[must_use]
    pub fn over(name: String, store: Box<dyn ObjectStore>) -> Self {
        Self { name, prefix: Path::default(), store, token: None }
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
        self.store.put(&self.path(key), bytes.to_vec().into()).await.map_err(|error| self.failed("put", &error))?;
        let expected = "to read back what was sent";
        let differs = |found| SendError::Differs { key: key.to_owned(), expected, found };
        let back = self.read(key, bytes.len() as u64).await?.map_err(differs)?;
        if back == bytes { Ok(()) } else { Err(differs(format!("bytes of BLAKE3 {}", hash(&back)))) }
    }

    /// The object, whose key names its hash as [`Destination::send`]'s callers have it: `.../HASH.EXTENSION`.
    ///
    /// # Errors
    /// [`SendError`] unless bytes of that hash came back.
    pub async fn fetch(&self, object: &Object) -> Result<Vec<u8>, SendError> {
        let key = &object.key;
        let expected = "the size that was listed and the hash that the key names";
        let differs = |found| SendError::Differs { key: key.clone(), expected, found };
        let bytes = self.read(key, object.size).await?.map_err(differs)?;
        let (found, name) = (hash(&bytes), key.rsplit('/').next().and_then(|file| file.split('.').next()));
        if name == Some(&found) { Ok(bytes) } else { Err(differs(format!("bytes of BLAKE3 {found}"))) }
    }

    /// What lies below a folder, by key.
    ///
    /// # Errors
    /// [`SendError::Server`] when the server cannot list, or lists more than [`MAX_LISTED`] objects.
    pub async fn list(&self, folder: &str) -> Result<Vec<Object>, SendError> {
        let depth = self.prefix.parts_count();
        let mut listed = self.store.list(Some(&self.path(folder)));
        let mut objects = Vec::new();
        while let Some(found) = listed.try_next().await.map_err(|error| self.failed("list", &error))? {
            if objects.len() == MAX_LISTED {
                let message = format!("{folder}: expected at most {MAX_LISTED} objects, found more");
                return Err(SendError::Server { doing: "list", message });
            }
            let key = found.location.parts().skip(depth).collect::<Path>().to_string();
            objects.push(Object { key, size: found.size });
        }
        objects.sort();
        Ok(objects)
    }

    /// An object of that size, or what is wrong with it.
    pub(super) async fn read(&self, key: &str, size: u64) -> Result<Result<Vec<u8>, String>, SendError> {
        if size > MAX_OBJECT as u64 {
            return Ok(Err(format!("{size} bytes, more than {MAX_OBJECT}")));
        }
        let back = match self.store.get(&self.path(key)).await {
            Err(object_store::Error::NotFound { .. }) => return Ok(Err("nothing".into())),
            back => back.map_err(|error| self.failed("get", &error))?,
        };
        if back.meta.size != size {
            return Ok(Err(format!("{} bytes in place of {size}", back.meta.size)));
        }
        let (mut stream, mut bytes) = (back.into_stream(), Vec::new());
        while let Some(chunk) = stream.next().await {
            bytes.extend_from_slice(&chunk.map_err(|error| self.failed("get", &error))?);
            // A server that goes on after what it announced is not listened to.
            if bytes.len() as u64 > size {
                return Ok(Err(format!("more than {size} bytes")));
            }
        }
        Ok(Ok(bytes))
    }

    fn path(&self, key: &str) -> Path {
        self.prefix.parts().chain(Path::parse(key).iter().flat_map(Path::parts)).collect()
    }

    fn failed(&self, doing: &'static str, error: &object_store::Error) -> SendError {
        SendError::Server { doing, message: self.message(error) }
    }

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
    let secret = Secret::load(config.secret_file.as_deref(), &config.credential)?;
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
    let secret = Secret::load(config.secret_file.as_deref(), &config.credential)?;
    Ok(secret.map(|secret| match &config.user {
        Some(user) => Secret::new(BASE64_STANDARD.encode(format!("{user}:{}", secret.reveal()))),
        None => secret,
    }))
}

fn server(config: &SyncConfig, url: &Url, token: Option<Secret>) -> Result<Box<dyn ObjectStore>, SyncError> {
    encrypted("url", url)?;
    let scheme = if config.user.is_some() { "Basic" } else { "Bearer" };
    let header = token.map(|token| authorization(scheme, &token)).transpose()?;
    let wire = Wire::new(config.ca_file.as_deref(), header)?;
    let options = ClientOptions::new().with_allow_http(url.scheme() == "http");
    let builder = HttpBuilder::new().with_url(url.origin().ascii_serialization()).with_client_options(options);
    let store = builder.with_retry(once()).with_http_connector(wire).build();
    Ok(Box::new(store.map_err(|error| SyncError::Client { message: chain(&error) })?))
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
