//! One connection, from the handshake to its end: what it may take of the server's time and memory.
use std::convert::Infallible;
use std::io;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::time::Duration;

use http_body_util::BodyExt as _;
use hyper::body::{Body as HttpBody, Bytes, Incoming};
use hyper::rt::bounds::Http2ServerConnExec;
use hyper::server::conn::{http1, http2};
use hyper::service::{HttpService, service_fn};
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use rustls::ServerConfig;
use tokio::net::TcpStream;
use tokio::sync::watch;
use tokio::time::{Instant, interval, sleep_until, timeout};
use tokio_rustls::TlsAcceptor;
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tonic::transport::server::TcpConnectInfo;
use tower::{Service, ServiceExt as _};

use crate::grpc::connections::{Activity, Place};
use crate::grpc::prefaced::Prefaced;

/// A connection that says nothing is asked whether it lives so often; a watcher that is gone is noticed by this.
const KEEPALIVE: Duration = Duration::from_secs(30);
const KEEPALIVE_ANSWER: Duration = Duration::from_secs(10);
/// A client that is told to connect anew gets so long to hear of it.
const GOODBYE: Duration = Duration::from_secs(5);
/// Calls of one connection at a time; more wait. Long answers, such as `WatchJob`'s, count until they end.
pub const CALLS_AT_ONCE: u32 = 256;
/// Bytes of an answer that wait for the network; each call has as many.
const SEND_BUFFER: usize = 32 << 10;
/// Bytes of requests that may be on the way to handlers that do not take them: of a connection, and of one of its calls.
const CONNECTION_WINDOW: u32 = 1 << 20;
const CALL_WINDOW: u32 = 256 << 10;

/// What is spoken on a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// gRPC over HTTP/2, and nothing else.
    Grpc,
    /// The page and its calls, gRPC-Web over HTTP/1.1.
    Page,
}

/// How connections are held.
#[derive(Clone)]
pub struct Manner {
    /// What is spoken.
    pub protocol: Protocol,
    /// TLS, if that is spoken; then nothing else is.
    pub tls: Option<Arc<ServerConfig>>,
    /// How long TLS and the preface of HTTP/2 may take.
    pub handshake: Duration,
    /// How long it may be open without a call, where that is limited.
    pub idle: Option<Duration>,
}

/// Serves a connection until it ends, gives way to another, or `stop` changes and its calls have ended.
pub async fn hold<S>(stream: TcpStream, place: Place, manner: Manner, service: S, mut stop: watch::Receiver<()>)
where
    S: Service<Request<Body>, Response = Response<Body>, Error = Infallible> + Clone + Send + 'static,
    S::Future: Send,
{
    let peer = TcpConnectInfo {
        local_addr: stream.local_addr().ok(),
        remote_addr: stream.peer_addr().ok(),
    };
    let activity = place.activity().clone();
    let serving = async {
        let Manner {
            protocol,
            tls,
            handshake,
            idle,
        } = manner;
        let call = call(peer, activity.clone(), service);
        match (protocol, tls) {
            (Protocol::Grpc, Some(tls)) => {
                let encrypted = async { Prefaced::read(TlsAcceptor::from(tls).accept(stream).await?).await };
                let io = begun(encrypted, handshake, &mut stop).await?;
                keep(grpc().serve_connection(TokioIo::new(io), call), activity, idle, stop).await
            }
            (Protocol::Grpc, None) => {
                let io = begun(Prefaced::read(stream), handshake, &mut stop).await?;
                keep(grpc().serve_connection(TokioIo::new(io), call), activity, idle, stop).await
            }
            (Protocol::Page, Some(tls)) => {
                let io = begun(TlsAcceptor::from(tls).accept(stream), handshake, &mut stop).await?;
                keep(
                    page(handshake).serve_connection(TokioIo::new(io), call),
                    activity,
                    idle,
                    stop,
                )
                .await
            }
            (Protocol::Page, None) => {
                let io = TokioIo::new(stream);
                keep(page(handshake).serve_connection(io, call), activity, idle, stop).await
            }
        }
    };
    tokio::select! {
        () = place.lost() => {}
        ended = serving => {
            if let Err(error) = ended {
                tracing::debug!(%error, "a connection ended");
            }
        }
    }
}

type Failure = Box<dyn std::error::Error + Send + Sync>;

async fn begun<IO>(
    handshake: impl Future<Output = io::Result<IO>>,
    limit: Duration,
    stop: &mut watch::Receiver<()>,
) -> Result<IO, Failure> {
    tokio::select! {
        io = timeout(limit, handshake) => Ok(io??),
        // It has no calls that would have to end.
        _ = stop.changed() => Err("the server is stopping".into()),
    }
}

/// What answers the requests of a connection.
fn call<S>(
    peer: TcpConnectInfo,
    activity: Arc<Activity>,
    service: S,
) -> impl HttpService<
    Incoming,
    ResBody = impl HttpBody<Data = Bytes, Error = Status> + Send + 'static,
    Error = Infallible,
    Future: Send,
>
where
    S: Service<Request<Body>, Response = Response<Body>, Error = Infallible> + Clone + Send + 'static,
    S::Future: Send,
{
    service_fn(move |request: Request<Incoming>| {
        let (service, call) = (service.clone(), activity.begin());
        let mut request = request.map(Body::new);
        request.extensions_mut().insert(peer.clone());
        async move {
            let answer = service.oneshot(request).await?;
            // It is under way until the last of its answer is sent, or nobody wants that any more.
            Ok::<_, Infallible>(answer.map(|body| {
                body.map_frame(move |frame| {
                    let _ = &call;
                    frame
                })
            }))
        }
    })
}

fn grpc() -> http2::Builder<TokioExecutor> {
    let mut http = http2::Builder::new(TokioExecutor::new());
    http.timer(TokioTimer::new())
        .max_concurrent_streams(CALLS_AT_ONCE)
        .keep_alive_interval(KEEPALIVE)
        .keep_alive_timeout(KEEPALIVE_ANSWER)
        .max_send_buf_size(SEND_BUFFER)
        .initial_stream_window_size(CALL_WINDOW)
        .initial_connection_window_size(CONNECTION_WINDOW);
    http
}

fn page(head: Duration) -> http1::Builder {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(head);
    http
}

/// A connection that can be told to end when its calls have.
trait Graceful: Future<Output = hyper::Result<()>> {
    fn end(self: Pin<&mut Self>);
}

impl<IO, S, B> Graceful for http1::Connection<IO, S>
where
    IO: hyper::rt::Read + hyper::rt::Write + Unpin,
    S: HttpService<Incoming, ResBody = B, Error: Into<Failure>>,
    B: HttpBody<Error: Into<Failure>> + 'static,
{
    fn end(self: Pin<&mut Self>) {
        self.graceful_shutdown();
    }
}

impl<IO, S, B, E> Graceful for http2::Connection<IO, S, E>
where
    IO: hyper::rt::Read + hyper::rt::Write + Unpin,
    S: HttpService<Incoming, ResBody = B, Error: Into<Failure>>,
    B: HttpBody<Error: Into<Failure>> + 'static,
    E: Http2ServerConnExec<S::Future, B>,
{
    fn end(self: Pin<&mut Self>) {
        self.graceful_shutdown();
    }
}

/// Drives a connection to its end, which comes by itself, when it has been idle for too long, or after `stop`.
async fn keep(
    connection: impl Graceful,
    activity: Arc<Activity>,
    idle: Option<Duration>,
    mut stop: watch::Receiver<()>,
) -> Result<(), Failure> {
    let mut connection = pin!(connection);
    let limit = idle.unwrap_or(Duration::MAX);
    let mut looks = interval(idle.map_or(KEEPALIVE, |idle| idle / 4));
    let mut end: Option<Instant> = None;
    let mut stopping = false;
    loop {
        let cut_off = async {
            match end {
                Some(end) => sleep_until(end).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            ended = connection.as_mut() => return Ok(ended?),
            _ = stop.changed(), if !stopping => {
                stopping = true;
                end = Some(Instant::now() + GOODBYE);
                connection.as_mut().end();
            }
            _ = looks.tick(), if end.is_none() => {
                if activity.idle_since().is_some_and(|since| since.elapsed() >= limit) {
                    end = Some(Instant::now() + GOODBYE);
                    connection.as_mut().end();
                }
            }
            () = cut_off => {
                // Calls that are under way are answered.
                if activity.idle_since().is_some() {
                    return Ok(());
                }
                end = Some(Instant::now() + GOODBYE);
            }
        }
    }
}
