use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use http_body_util::{BodyExt, Limited};
use object_store::ClientOptions;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpResponseBody, HttpService,
};
use reqwest::Url;
use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderValue};
use rustls::RootCertStore;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;

use super::error::SyncError;

/// Most of a reply that is read, bytes, where it is no object of ours (spec/reliability.md 15).
pub const MAX_REPLY: usize = 64 << 10;
/// Most of an object or of a listing, bytes: above any that we send. Objects besides are read as far as their size.
pub(super) const MAX_OBJECT: usize = 64 << 20;
/// Longest wait for a connection, for the next byte, and for a whole request: guesses for a slow field link.
const CONNECT: Duration = Duration::from_secs(15);
const SILENCE: Duration = Duration::from_secs(30);
const REQUEST: Duration = Duration::from_secs(300);

/// Requests as we allow them: verified TLS, no redirects, no proxies, bounded replies.
#[derive(Clone, Debug)]
pub(super) struct Wire(reqwest::Client);

impl Wire {
    /// A client that trusts the certificates in `ca_file` alone, else the system's, and sends `authorization` along.
    pub(super) fn new(ca_file: Option<&Path>, authorization: Option<HeaderValue>) -> Result<Self, SyncError> {
        let mut headers = HeaderMap::new();
        if let Some(value) = authorization {
            headers.insert(AUTHORIZATION, value);
        }
        let client = builder(roots(ca_file)?)?.default_headers(headers).timeout(REQUEST).build();
        Ok(Self(client.map_err(|error| SyncError::Client { message: error.to_string() })?))
    }

    /// The client, for requests whose answers [`super::answer`] bounds.
    pub(super) fn client(&self) -> &reqwest::Client {
        &self.0
    }
}

/// A client that verifies certificates by these roots and goes nowhere but where it is told to.
pub(super) fn builder(roots: RootCertStore) -> Result<reqwest::ClientBuilder, SyncError> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let versions = rustls::ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions();
    let tls = versions.map_err(|error| SyncError::Client { message: error.to_string() })?;
    Ok(reqwest::Client::builder()
        .tls_backend_preconfigured(tls.with_root_certificates(roots).with_no_client_auth())
        .redirect(reqwest::redirect::Policy::none())
        .retry(reqwest::retry::never())
        .no_proxy()
        .http1_only()
        .connect_timeout(CONNECT)
        .read_timeout(SILENCE))
}

/// Without TLS only this machine itself is spoken to.
pub(super) fn encrypted(key: &'static str, url: &Url) -> Result<(), SyncError> {
    let host = url.host_str().unwrap_or_default();
    let loopback =
        host == "localhost" || host.trim_matches(['[', ']']).parse().is_ok_and(|ip: std::net::IpAddr| ip.is_loopback());
    if url.scheme() == "https" || loopback {
        return Ok(());
    }
    Err(SyncError::Config { key, expected: "https, except on this machine", found: url.to_string() })
}

/// The certificates that are trusted.
fn roots(ca_file: Option<&Path>) -> Result<RootCertStore, SyncError> {
    let mut roots = RootCertStore::empty();
    let Some(path) = ca_file else {
        // One bad certificate among the system's is no reason to distrust the others.
        roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
        return Ok(roots);
    };
    let wrong = |found: String| SyncError::File { path: path.into(), expected: "certificates in PEM", found };
    let certificates = CertificateDer::pem_file_iter(path).map_err(|error| wrong(error.to_string()))?;
    for certificate in certificates {
        let certificate = certificate.map_err(|error| wrong(error.to_string()))?;
        roots.add(certificate).map_err(|error| wrong(error.to_string()))?;
    }
    if roots.is_empty() { Err(wrong("none".into())) } else { Ok(roots) }
}

impl HttpConnector for Wire {
    fn connect(&self, _options: &ClientOptions) -> object_store::Result<HttpClient> {
        Ok(HttpClient::new(self.clone()))
    }
}

#[async_trait]
impl HttpService for Wire {
    async fn call(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        // WebDAV lists with a method of its own.
        let reading = matches!(request.method().as_str(), "GET" | "PROPFIND");
        let (parts, body) = self.0.call(request).await?.into_parts();
        let limit = if reading && parts.status.is_success() { MAX_OBJECT } else { MAX_REPLY };
        let body = Limited::new(body, limit).map_err(|error| HttpError::new_boxed(HttpErrorKind::Decode, error));
        Ok(HttpResponse::from_parts(parts, HttpResponseBody::new(body)))
    }
}
