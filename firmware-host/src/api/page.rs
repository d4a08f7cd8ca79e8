//! The page's files and the description of the API, inside the program: it works without a network and without files beside it.

use axum::Router;
use axum::http::header::CONTENT_TYPE;
use axum::routing::get;

use super::Api;

/// Path, type and bytes of each file.
const FILES: [(&str, &str, &[u8]); 5] = [
    ("/", "text/html; charset=utf-8", include_bytes!("../../../web/index.html")),
    ("/openapi.json", "application/json", include_bytes!("openapi.json")),
    ("/app.js", "text/javascript; charset=utf-8", include_bytes!("../../../web/app.js")),
    ("/style.css", "text/css; charset=utf-8", include_bytes!("../../../web/style.css")),
    (
        "/vendor/model-viewer.min.js",
        "text/javascript; charset=utf-8",
        include_bytes!("../../../web/vendor/model-viewer.min.js"),
    ),
];

pub(super) fn routes() -> Router<Api> {
    FILES.into_iter().fold(Router::new(), |router, (path, media, bytes)| {
        router.route(path, get(move || async move { ([(CONTENT_TYPE, media)], bytes) }))
    })
}
