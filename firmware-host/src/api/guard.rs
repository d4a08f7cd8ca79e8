use axum::extract::{Request, State};
use axum::http::{HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::Api;
use super::reply::ApiError;

/// What the page may do: nothing from elsewhere. The 3D view makes blobs for its textures, its shadow tree brings style
/// elements of its own, and it compiles a small decoder to WebAssembly when it starts (which allows no JavaScript eval).
const POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' blob: data:; connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Refuses requests whose Host is not this machine's own name: a page elsewhere whose name was rebound to 127.0.0.1
/// sends its own.
pub(super) async fn host(State(api): State<Api>, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
    let known = host.is_some_and(|host| ours(&api, host));
    if known { next.run(request).await } else { ApiError::forbidden("unknown Host").into_response() }
}

/// Refuses what changes something when a page elsewhere asks for it; programs that are no browsers name no origin.
pub(super) async fn origin(State(api): State<Api>, request: Request, next: Next) -> Response {
    let origin = request.headers().get(header::ORIGIN).map(|origin| origin.to_str().unwrap_or_default());
    let host = origin.map(|origin| origin.split_once("://").map_or(origin, |(_, host)| host));
    if request.method().is_safe() || host.is_none_or(|host| ours(&api, host)) {
        next.run(request).await
    } else {
        ApiError::forbidden("unknown Origin").into_response()
    }
}

/// True for this machine's own names, with our port or none.
fn ours(api: &Api, host: &str) -> bool {
    let port = format!(":{}", api.inner.port);
    let name = host.strip_suffix(&port).unwrap_or(host);
    ["localhost", "127.0.0.1", "[::1]"].iter().any(|ours| name.eq_ignore_ascii_case(ours))
}

/// Headers of every answer.
pub(super) async fn headers(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}
