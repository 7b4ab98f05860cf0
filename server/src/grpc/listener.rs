//! The listener: the transport's settings, and calls until somebody says stop.
use std::time::Duration;

use tokio::net::TcpListener;
use tonic::service::Routes;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Server, ServerTlsConfig};

use crate::error::{Error, Result};
use crate::grpc::deadline::Deadlines;
use crate::grpc::guard::Guard;
use crate::grpc::metrics_layer::Measured;
use crate::grpc::transport_errors::Explained;

/// A connection that says nothing is asked whether it lives so often; a watcher that is gone is noticed by this.
const KEEPALIVE: Duration = Duration::from_secs(30);
const KEEPALIVE_ANSWER: Duration = Duration::from_secs(10);

/// Calls of one connection at a time; more wait. Long answers, such as `WatchJob`'s, count until they end.
const CALLS_AT_ONCE: u32 = 256;

/// Who is let in, and how.
pub struct Door {
    /// Who.
    pub guard: Guard,
    /// TLS, if that is spoken; then nothing else is.
    pub tls: Option<ServerTlsConfig>,
    /// What counts calls.
    pub measured: Measured,
}

/// Answers calls that come through `door` until `shutdown`, then finishes those that have begun.
pub async fn serve(
    routes: Routes,
    door: Door,
    listener: TcpListener,
    shutdown: impl Future<Output = ()>,
) -> Result<()> {
    // Set here because tonic's own setting is for listeners that it makes itself.
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
    let failed = |error| Error::internal("the listener", error);
    let mut server = Server::builder();
    if let Some(tls) = door.tls {
        server = server.tls_config(tls).map_err(failed)?;
    }
    server
        .max_concurrent_streams(CALLS_AT_ONCE)
        .concurrency_limit_per_connection(CALLS_AT_ONCE as usize)
        .http2_keepalive_interval(Some(KEEPALIVE))
        .http2_keepalive_timeout(Some(KEEPALIVE_ANSWER))
        .layer(door.measured)
        .layer(Explained)
        .layer(Deadlines)
        .layer(door.guard)
        .add_routes(routes)
        .serve_with_incoming_shutdown(incoming, shutdown)
        .await
        .map_err(failed)
}
