//! The listener: takes connections, and calls that come by them, until somebody says stop.
use std::convert::Infallible;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use rustls::ServerConfig;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep};
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tonic::service::Routes;
use tower::limit::ConcurrencyLimit;
use tower::{Layer, Service};

use crate::error::Result;
use crate::grpc::around::Around;
pub use crate::grpc::connection::Protocol;
use crate::grpc::connection::{self, CALLS_AT_ONCE, Manner};
pub use crate::grpc::connections::ConnectionLimits;
use crate::grpc::connections::Connections;
use crate::grpc::deadline::Deadlines;
use crate::grpc::guard::Guard;
use crate::grpc::transport_errors::ErrorDetailsLayer;
use crate::page::{PageLayer, Resolution};
use crate::service::Service as Api;

/// TLS and the preface of HTTP/2 may take so long, unless something else is asked for.
pub const HANDSHAKE: Duration = Duration::from_secs(10);
/// After an error of the listener, such as too many open files, which stays as it is if it is asked again at once.
const PAUSE: Duration = Duration::from_millis(100);
/// Such errors are told so often at most.
const TELL_EVERY: Duration = Duration::from_secs(10);

/// Who is let in, and how.
pub struct ListenerOptions {
    /// Who.
    pub guard: Guard,
    /// TLS, if that is spoken; then nothing else is.
    pub tls: Option<Arc<ServerConfig>>,
    /// What is spoken.
    pub protocol: Protocol,
    /// How many connections there may be.
    pub connections: ConnectionLimits,
    /// How long TLS and the preface of HTTP/2 may take.
    pub handshake: Duration,
    /// How long a connection may be open without a call, where that is limited.
    pub idle: Option<Duration>,
    /// What counts calls, and resolves beside the page where [`Protocol::Page`] is spoken.
    pub api: Api,
}

/// Answers calls that come through `door` until `shutdown`, then finishes those that have begun. When it is dropped
/// before, all connections are cut off.
pub async fn serve(
    routes: Routes,
    door: ListenerOptions,
    listener: TcpListener,
    shutdown: impl Future<Output = ()>,
) -> Result<()> {
    let connections = Connections::new(door.connections, door.api.metrics());
    let service = door.guard.layer(routes.prepare());
    let service = Around(ErrorDetailsLayer).layer(Around(Deadlines).layer(service));
    let service = door.api.measured().layer(service);
    match door.protocol {
        Protocol::Grpc => accept(connections, service, door, listener, shutdown).await,
        Protocol::Page => {
            let resolution = Resolution {
                api: door.api.clone(),
                guard: door.guard.clone(),
            };
            let service = PageLayer::new(resolution).layer(service);
            accept(connections, service, door, listener, shutdown).await;
        }
    }
    Ok(())
}

/// Takes connections until `shutdown`, then waits for those that have begun.
async fn accept<S>(
    connections: Arc<Connections>,
    service: S,
    door: ListenerOptions,
    listener: TcpListener,
    shutdown: impl Future<Output = ()>,
) where
    S: Service<Request<Body>, Response = Response<Body>, Error = Infallible> + Clone + Send + 'static,
    S::Future: Send,
{
    let manner = Manner {
        protocol: door.protocol,
        tls: door.tls,
        handshake: door.handshake,
        idle: door.idle,
    };
    let (stop, stopping) = watch::channel(());
    let mut held = JoinSet::new();
    let mut shutdown = std::pin::pin!(shutdown);
    let mut told: Option<Instant> = None;
    loop {
        let stream = tokio::select! {
            () = &mut shutdown => break,
            Some(_) = held.join_next() => continue,
            stream = accepted(&listener) => stream,
        };
        match stream {
            Ok((stream, address)) => {
                // Whoever finds no place is told so by the end of the connection.
                if let Some(place) = connections.take(address) {
                    let service = ConcurrencyLimit::new(service.clone(), CALLS_AT_ONCE as usize);
                    held.spawn(connection::hold(
                        stream,
                        place,
                        manner.clone(),
                        service,
                        stopping.clone(),
                    ));
                }
            }
            Err(error) => {
                if told.is_none_or(|at| at.elapsed() >= TELL_EVERY) {
                    told = Some(Instant::now());
                    tracing::warn!(%error, "connections can't be taken");
                }
                sleep(PAUSE).await;
            }
        }
    }
    // Nobody is to connect and then wait for nothing.
    drop(listener);
    let _ = stop.send(());
    while held.join_next().await.is_some() {}
}

/// The next connection, and where it comes from.
async fn accepted(listener: &TcpListener) -> io::Result<(TcpStream, std::net::IpAddr)> {
    loop {
        match listener.accept().await {
            Ok((stream, address)) => {
                // Messages are small, and waited for.
                stream.set_nodelay(true)?;
                return Ok((stream, address.ip()));
            }
            // That one is gone again.
            Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => {}
            Err(error) => return Err(error),
        }
    }
}
