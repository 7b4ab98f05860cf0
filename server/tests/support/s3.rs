//! An S3 server for tests: s3s over a temporary folder, in this process, reached by a socket. It checks signatures, and has
//! the faults that a test asks for.
#![allow(dead_code)] // each program of tests needs a part
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use futures::stream;
use http_body_util::{BodyExt, StreamBody};
use hyper::body::{Frame, Incoming};
use hyper::service::{Service, service_fn};
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioExecutor, TokioIo};
use hyper_util::server::conn::auto::Builder;
use s3s::Body;
use s3s::auth::SimpleAuth;
use s3s::service::{S3ServiceBuilder, SharedS3Service};
use s3s_fs::FileSystem;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;

/// The bucket that is there.
pub const BUCKET: &str = "guardsplat";
/// Who may use it.
const ID: &str = "tester";
const SECRET: &str = "5ec2e7";

type Failure = Box<dyn Error + Send + Sync>;

/// What goes wrong, each in so many of 1000 requests.
#[derive(Debug, Default)]
pub struct Faults {
    /// Answered with an error, before anything is done.
    pub refused: AtomicU64,
    /// Done, and the connection closed in place of an answer.
    pub unanswered: AtomicU64,
    /// Done, and the answer's bytes cut off in the middle.
    pub cut: AtomicU64,
    /// Milliseconds that every request takes longer.
    pub latency: AtomicU64,
    /// Milliseconds that a part takes longer once it has arrived; then nobody needs to wait for it any more.
    pub stored_late: AtomicU64,
    /// Parts that have arrived and are not stored yet, and uploads that were given up meanwhile.
    late: AtomicU64,
    pub given_up_early: AtomicU64,
    /// Nothing is answered at all.
    pub silent: AtomicBool,
    /// Requests so far, and those of them with a fault.
    pub requests: AtomicU64,
    pub faults: AtomicU64,
    dice: AtomicU64,
}

enum Fault {
    None,
    Refused,
    Unanswered,
    Cut,
}

impl Faults {
    fn next(&self) -> Fault {
        let rolled = self
            .dice
            .fetch_add(1, Ordering::Relaxed)
            .wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let rolled = (rolled ^ (rolled >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mut rolled = (rolled >> 33) % 1000;
        for (share, fault) in [
            (&self.refused, Fault::Refused),
            (&self.unanswered, Fault::Unanswered),
            (&self.cut, Fault::Cut),
        ] {
            let share = share.load(Ordering::Relaxed);
            if rolled < share {
                self.faults.fetch_add(1, Ordering::Relaxed);
                return fault;
            }
            rolled -= share;
        }
        Fault::None
    }
}

/// A running server.
pub struct Endpoint {
    address: String,
    folder: TempDir,
    /// What goes wrong.
    pub faults: Arc<Faults>,
    serving: JoinHandle<()>,
}

impl Endpoint {
    /// Starts a server with an empty bucket.
    pub async fn start() -> Self {
        let folder = TempDir::new().unwrap();
        std::fs::create_dir(folder.path().join(BUCKET)).unwrap();
        let mut builder = S3ServiceBuilder::new(FileSystem::new(folder.path()).unwrap());
        builder.set_auth(SimpleAuth::from_single(ID, SECRET));
        let service = builder.build().into_shared();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let faults = Arc::new(Faults::default());
        let serving = tokio::spawn(serve(listener, service, faults.clone()));
        Self {
            address,
            folder,
            faults,
            serving,
        }
    }

    /// The variables that say where it is, and who asks.
    pub fn environment(&self) -> Vec<(String, String)> {
        self.environment_of(ID)
    }

    /// As [`Self::environment`], for somebody else.
    pub fn environment_of(&self, id: &str) -> Vec<(String, String)> {
        let variables = [
            ("AWS_ENDPOINT", self.address.as_str()),
            ("AWS_ALLOW_HTTP", "true"),
            ("AWS_REGION", "us-east-1"),
            ("AWS_ACCESS_KEY_ID", id),
            ("AWS_SECRET_ACCESS_KEY", SECRET),
        ];
        variables.map(|(name, value)| (name.into(), value.into())).to_vec()
    }

    /// Ends it, as if its machine were gone.
    pub fn end(&self) {
        self.serving.abort();
    }

    /// All objects of the bucket, as files; without what says whose they are.
    pub fn objects(&self) -> Vec<PathBuf> {
        let mut found = Vec::new();
        walk(&self.folder.path().join(BUCKET), &mut found);
        found.retain(|path| !path.ends_with("generation") && !path.ends_with("contested"));
        found
    }

    /// Files of parts that belong to no object yet.
    pub fn parts(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let paths = entries.flatten().map(|entry| entry.path());
        paths.filter(|path| path.to_string_lossy().contains(".part-")).collect()
    }

    /// Where a key of the bucket lies.
    pub fn path(&self, key: &str) -> PathBuf {
        self.folder.path().join(BUCKET).join(key)
    }
}

impl Drop for Endpoint {
    fn drop(&mut self) {
        self.end();
    }
}

fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.path().is_dir() {
            true => walk(&entry.path(), found),
            false => found.push(entry.path()),
        }
    }
}

async fn serve(listener: TcpListener, service: SharedS3Service, faults: Arc<Faults>) {
    // Connections end with the server.
    let mut connections = tokio::task::JoinSet::new();
    loop {
        let Ok((socket, _)) = listener.accept().await else {
            return;
        };
        let (service, faults) = (service.clone(), faults.clone());
        connections.spawn(async move {
            let answers = service_fn(move |request| answer(service.clone(), faults.clone(), request));
            let http = Builder::new(TokioExecutor::new());
            // A connection that breaks is the other side's to tell.
            let _ = http.serve_connection(TokioIo::new(socket), answers).await;
        });
    }
}

async fn answer(
    service: SharedS3Service,
    faults: Arc<Faults>,
    request: Request<Incoming>,
) -> Result<Response<Body>, Failure> {
    faults.requests.fetch_add(1, Ordering::Relaxed);
    if faults.silent.load(Ordering::Relaxed) {
        std::future::pending::<()>().await;
    }
    tokio::time::sleep(Duration::from_millis(faults.latency.load(Ordering::Relaxed))).await;
    match faults.next() {
        // s3s-fs makes buckets when they are written to, which S3 does not.
        Fault::None if !request.uri().path().starts_with(&format!("/{BUCKET}")) => {
            Ok(refused(StatusCode::NOT_FOUND, "NoSuchBucket"))
        }
        Fault::None if is_part(&request) => store_part(service, faults, request).await,
        Fault::None => {
            if request.method() == Method::DELETE && faults.late.load(Ordering::Relaxed) > 0 {
                faults.given_up_early.fetch_add(1, Ordering::Relaxed);
            }
            Ok(service.call(request).await?)
        }
        Fault::Refused => Ok(refused(StatusCode::SERVICE_UNAVAILABLE, "SlowDown")),
        Fault::Unanswered => {
            service.call(request).await?;
            Err("this answer is lost".into())
        }
        Fault::Cut => {
            let (head, body) = service.call(request).await?.into_parts();
            let bytes = body.collect().await?.to_bytes();
            let half = Frame::data(bytes.slice(..bytes.len() / 2));
            let frames = [Ok(half), Err::<_, Failure>("this answer is cut off".into())];
            Ok(Response::from_parts(
                head,
                Body::http_body_unsync(StreamBody::new(stream::iter(frames))),
            ))
        }
    }
}

fn is_part(request: &Request<Incoming>) -> bool {
    let query = request.uri().query().unwrap_or_default();
    request.method() == Method::PUT && query.contains("partNumber")
}

/// As S3 does: a part that has arrived is stored even if whoever sent it is gone.
async fn store_part(
    service: SharedS3Service,
    faults: Arc<Faults>,
    request: Request<Incoming>,
) -> Result<Response<Body>, Failure> {
    let (head, body) = request.into_parts();
    let body = body.collect().await?.to_bytes();
    let stored = tokio::spawn(async move {
        faults.late.fetch_add(1, Ordering::Relaxed);
        tokio::time::sleep(Duration::from_millis(faults.stored_late.load(Ordering::Relaxed))).await;
        let request = Request::from_parts(head, Body::from(body));
        let stored = service.as_ref().call(request).await;
        faults.late.fetch_sub(1, Ordering::Relaxed);
        stored
    });
    Ok(stored.await??)
}

fn refused(status: StatusCode, code: &str) -> Response<Body> {
    let mut refused = Response::new(Body::from(format!("<Error><Code>{code}</Code></Error>")));
    *refused.status_mut() = status;
    refused
}
