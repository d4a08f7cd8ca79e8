//! The status API and the page (spec/appliance.md "Status API and page"): read-only, on loopback alone.
//!
//! The routes live in `cameras`, `plants`, `status` and `sync`, the page's files in `page`; `guard` stands before all of them.

mod cameras;
mod guard;
mod page;
mod plants;
mod reply;
mod status;
mod sync;

use std::future::{Future, IntoFuture};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Router;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post};
use metrics_exporter_prometheus::{PrometheusHandle, PrometheusRecorder};
use tokio::net::TcpListener;
use tokio::sync::{Notify, watch};

use crate::pipeline::Views;
use crate::status::Status;
use crate::store::{Reader, StoreError};
use crate::sync::Attendant;
use cameras::Previews;
use reply::ApiError;
pub use sync::SyncStatus;

/// How long open connections may finish after the program was asked to stop: a guess.
const GRACE: Duration = Duration::from_secs(3);

/// What every route works on; cheap to clone.
#[derive(Clone)]
pub struct Api {
    inner: Arc<Inner>,
}

struct Inner {
    /// One reader: SQLite's calls block, so they run on tokio's threads for blocking work, one at a time.
    reader: Mutex<Reader>,
    status: watch::Receiver<Status>,
    views: Views,
    previews: Previews,
    attendant: Attendant,
    recorder: Arc<PrometheusRecorder>,
    metrics: PrometheusHandle,
    port: u16,
}

impl Api {
    /// An API over a store; `status` is what the daemon says about itself, `views` is what its cameras see, `attendant`
    /// does the sync, `address` is where it listens.
    #[must_use]
    pub fn new(
        reader: Reader,
        status: watch::Receiver<Status>,
        views: Views,
        attendant: Attendant,
        recorder: Arc<PrometheusRecorder>,
        address: SocketAddr,
    ) -> Self {
        let (metrics, port) = (recorder.handle(), address.port());
        let (reader, previews) = (Mutex::new(reader), Previews::default());
        Self { inner: Arc::new(Inner { reader, status, views, previews, attendant, recorder, metrics, port }) }
    }

    /// Answers requests until `stop` is done.
    ///
    /// # Errors
    /// The listener's own.
    pub async fn serve(self, listener: TcpListener, stop: impl Future<Output = ()>) -> std::io::Result<()> {
        let stopped = Arc::new(Notify::new());
        let signal = stopped.clone();
        let server =
            axum::serve(listener, self.routes()).with_graceful_shutdown(async move { signal.notified().await });
        let mut server = std::pin::pin!(server.into_future());
        tokio::select! {
            result = &mut server => result,
            () = stop => {
                stopped.notify_one();
                // A client that never closes must not keep the program.
                tokio::time::timeout(GRACE, server).await.unwrap_or(Ok(()))
            }
        }
    }

    /// True while the store answers: the heartbeat of the watchdog.
    pub async fn alive(&self) -> bool {
        self.read(Reader::summary).await.is_ok()
    }

    fn routes(self) -> Router {
        let v1 = Router::new()
            .route("/status", get(status::status))
            .route("/cameras", get(cameras::list))
            .route("/cameras/{id}/preview.jpg", get(cameras::preview))
            .route("/sync", get(sync::show))
            .route("/sync/run", post(sync::run))
            .route("/plants", get(plants::list))
            .route("/plants/{id}", get(plants::show))
            .route("/plants/{id}/mesh.glb", get(plants::mesh))
            .route("/plants/{id}/record", get(plants::record))
            .route("/plants/{id}/thumbnail", get(plants::thumbnail));
        page::routes()
            .route("/healthz", get(status::healthz))
            .route("/metrics", get(status::metrics))
            .nest("/api/v1", v1)
            .fallback(async || ApiError::not_found("no such page"))
            .method_not_allowed_fallback(async || ApiError::method())
            .layer(from_fn_with_state(self.clone(), guard::origin))
            .layer(from_fn_with_state(self.clone(), guard::host))
            .layer(from_fn(guard::headers))
            .with_state(self)
    }

    /// Reads the store off the async threads.
    async fn read<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Reader) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, ApiError> {
        let inner = self.inner.clone();
        // A panic while reading leaves a connection without a transaction, which is as good as new.
        let call = move || read(&inner.reader.lock().unwrap_or_else(PoisonError::into_inner));
        match tokio::task::spawn_blocking(call).await {
            Ok(result) => Ok(result?),
            Err(panic) => Err(ApiError::internal(&panic)),
        }
    }
}
