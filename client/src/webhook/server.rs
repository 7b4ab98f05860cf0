//! A small HTTP server: takes POST requests with bodies of a bounded length, and hands them on one after the other.
//!
//! Whoever works on the requests may take longer than the caller waits. The work is done all the same; a caller that
//! comes again finds it done.
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{AUTHORIZATION, HeaderMap};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::time::timeout;

use crate::error::{Error, Result};

/// Most bytes of a body. What is taken here tells of things, and holds none of them.
const MAX_BODY: usize = 1 << 20;
/// Most bytes of a head.
const MAX_HEAD: usize = 16 << 10;
/// Connections at a time.
const CONNECTIONS: usize = 64;
/// Requests that may wait to be worked on.
const WAITING: usize = 64;
/// How long a caller may take to say what it wants.
const PATIENCE: Duration = Duration::from_secs(15);

/// A request that was let in, and waits to be worked on.
pub struct Call {
    /// What was posted.
    pub body: Bytes,
    answer: oneshot::Sender<bool>,
}

impl Call {
    /// Tells the caller whether it was done. It may have gone, which is its right.
    pub fn answer(self, done: bool) {
        let _ = self.answer.send(done);
    }
}

/// Looks at a request before anything is done for it.
pub type Doorkeeper = dyn Fn(&HeaderMap, &[u8]) -> std::result::Result<(), StatusCode> + Send + Sync;

/// Listens, and gives out requests that the doorkeeper lets in.
pub async fn listen(address: SocketAddr, doorkeeper: Arc<Doorkeeper>) -> Result<(SocketAddr, mpsc::Receiver<Call>)> {
    let failed = |source| Error::Listen { address, source };
    let listener = TcpListener::bind(address).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let (calls, waiting) = mpsc::channel(WAITING);
    tokio::spawn(accept(listener, doorkeeper, calls));
    Ok((address, waiting))
}

async fn accept(listener: TcpListener, doorkeeper: Arc<Doorkeeper>, calls: mpsc::Sender<Call>) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok(place) = places.clone().acquire_owned().await else {
            return;
        };
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(_) => {
                // A connection that broke at once, or no room for another: neither is a reason to end.
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let (doorkeeper, calls) = (doorkeeper.clone(), calls.clone());
        tokio::spawn(async move {
            let service = service_fn(move |request| {
                let (doorkeeper, calls) = (doorkeeper.clone(), calls.clone());
                async move { Ok::<_, Infallible>(serve(request, &*doorkeeper, &calls).await) }
            });
            let mut builder = http1::Builder::new();
            builder
                .timer(TokioTimer::new())
                .header_read_timeout(PATIENCE)
                .max_buf_size(MAX_HEAD);
            // Whatever goes wrong on it, it is one connection.
            let _ = builder.serve_connection(TokioIo::new(stream), service).await;
            drop(place);
        });
    }
}

async fn serve(
    request: Request<Incoming>,
    doorkeeper: &Doorkeeper,
    calls: &mpsc::Sender<Call>,
) -> Response<Full<Bytes>> {
    let status = match take(request, doorkeeper, calls).await {
        Ok(true) => StatusCode::NO_CONTENT,
        Ok(false) => StatusCode::INTERNAL_SERVER_ERROR,
        Err(status) => status,
    };
    let mut response = Response::new(Full::default());
    *response.status_mut() = status;
    response
}

async fn take(
    request: Request<Incoming>,
    doorkeeper: &Doorkeeper,
    calls: &mpsc::Sender<Call>,
) -> std::result::Result<bool, StatusCode> {
    let (head, body) = request.into_parts();
    if head.method != Method::POST {
        return Err(StatusCode::METHOD_NOT_ALLOWED);
    }
    let body = timeout(PATIENCE, Limited::new(body, MAX_BODY).collect()).await;
    let body = body.map_err(|_| StatusCode::REQUEST_TIMEOUT)?;
    let body = body.map_err(|_| StatusCode::PAYLOAD_TOO_LARGE)?.to_bytes();
    doorkeeper(&head.headers, &body)?;
    let (answer, done) = oneshot::channel();
    calls
        .try_send(Call { body, answer })
        .map_err(|_| StatusCode::SERVICE_UNAVAILABLE)?;
    done.await.map_err(|_| StatusCode::SERVICE_UNAVAILABLE)
}

/// The token that a request shows.
pub fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, token) = headers.get(AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}
