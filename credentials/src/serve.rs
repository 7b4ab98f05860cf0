//! `serve`: answers the C2PA's Soft Binding Resolution API from a folder, over plain HTTP.
use std::convert::Infallible;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use guardsplat_soft_binding::resolution::MAX_BODY;
use http_body_util::{BodyExt as _, Full, Limited};
use hyper::body::{Body as _, Bytes, Incoming};
use hyper::header::{AUTHORIZATION, CONTENT_TYPE, HeaderValue, WWW_AUTHENTICATE};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use sha2::{Digest as _, Sha256};
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

use crate::api::{self, Answer};
use crate::error::{Error, Result};
use crate::print_line;
use crate::store::Store;

/// Connections at a time; more wait.
const CONNECTIONS: usize = 64;
/// How long a connection may say nothing, and a request may take.
const SILENCE: Duration = Duration::from_secs(30);
/// After an error of the listener, such as too many open files.
const PAUSE: Duration = Duration::from_millis(100);
/// The folder is looked at again after this.
const REFRESH: Duration = Duration::from_secs(1);
/// Arguments of `serve`.
#[derive(Args)]
pub struct Arguments {
    /// The folder with credentials (.c2pa); what is put there later is found, too
    #[arg(long, value_name = "FOLDER")]
    store: PathBuf,
    /// Address and port to listen on; port 0 takes any that is free
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:50052")]
    listen: SocketAddr,
    /// A file with the token that callers must show (`Authorization: Bearer`)
    #[arg(long, value_name = "FILE", conflicts_with = "public")]
    token_file: Option<PathBuf>,
    /// Lets everybody ask who reaches the address, also from other machines
    #[arg(long)]
    public: bool,
}

/// What requests are answered from.
struct Service {
    store: Mutex<(Store, Instant)>,
    /// SHA-256 of the token that is wanted.
    token: Option<[u8; 32]>,
}

/// Answers until the process is ended.
pub fn run(arguments: &Arguments) -> Result<()> {
    if !arguments.listen.ip().is_loopback() && arguments.token_file.is_none() && !arguments.public {
        return Err(Error::Serve(format!(
            "--listen {}: other machines may reach it; give --token-file, or --public if everybody may ask",
            arguments.listen
        )));
    }
    let token = arguments.token_file.as_ref().map(|path| {
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        match text.trim() {
            "" => Err(Error::file(path, "there is no token in it")),
            token => Ok(Sha256::digest(token).into()),
        }
    });
    let store = Store::open(&arguments.store)?;
    eprintln!("{} credentials in {}", store.len(), arguments.store.display());
    let service = Arc::new(Service {
        store: Mutex::new((store, Instant::now())),
        token: token.transpose()?,
    });
    let failed = |error: std::io::Error| Error::Serve(format!("--listen {}: {error}", arguments.listen));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(failed)?;
    runtime.block_on(async {
        let listener = TcpListener::bind(arguments.listen).await.map_err(failed)?;
        print_line(&format!(
            "listening on http://{}",
            listener.local_addr().map_err(failed)?
        ));
        accept(&listener, &service).await;
        Ok(())
    })
}

async fn accept(listener: &TcpListener, service: &Arc<Service>) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    // It is never closed.
    while let Ok(place) = places.clone().acquire_owned().await {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let service = service.clone();
        tokio::spawn(async move {
            let answer = service_fn(move |request| {
                let service = service.clone();
                async move { Ok::<_, Infallible>(service.answer(request).await) }
            });
            let connection = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(SILENCE)
                .serve_connection(TokioIo::new(stream), answer);
            // Whoever breaks off has no need to be told of it.
            let _ = connection.await;
            drop(place);
        });
    }
}

impl Service {
    async fn answer(self: Arc<Self>, request: Request<Incoming>) -> Response<Full<Bytes>> {
        // What the service knows to read says nothing of anybody.
        let open = request.uri().path() == "/services/supportedAlgorithms";
        if !open && !self.may_ask(&request) {
            let told = "a token is needed, as Authorization: Bearer\n";
            let mut response = response((StatusCode::UNAUTHORIZED, "text/plain; charset=utf-8", told.into()));
            let headers = response.headers_mut();
            headers.insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
            return response;
        }
        let (head, body) = request.into_parts();
        // Scenes are not read here, so that how long they are does not matter.
        let unread = head.uri.path() == "/matches/byContent";
        let body = match within_limits(body).await {
            Some(body) => body,
            None if unread => Bytes::new(),
            None => {
                let told = format!("a question has at most {MAX_BODY} bytes, and comes within {SILENCE:?}\n");
                return response((StatusCode::PAYLOAD_TOO_LARGE, "text/plain; charset=utf-8", told.into()));
            }
        };
        let answered = tokio::task::spawn_blocking(move || {
            let query = head.uri.query().unwrap_or_default();
            self.with_store(|store| api::answer(store, &head.method, head.uri.path(), query, &body))
        });
        response(answered.await.unwrap_or_else(|error| {
            let told = format!("{error}\n");
            (
                StatusCode::INTERNAL_SERVER_ERROR,
                "text/plain; charset=utf-8",
                told.into(),
            )
        }))
    }

    fn with_store(&self, answer: impl FnOnce(&Store) -> Answer) -> Answer {
        let mut guard = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        let (store, looked) = &mut *guard;
        if looked.elapsed() >= REFRESH {
            *looked = Instant::now();
            // What was there is still good.
            if let Err(error) = store.refresh() {
                eprintln!("error: {error}");
            }
        }
        answer(store)
    }

    /// Hashes are compared: how long that takes tells nothing of the token.
    fn may_ask(&self, request: &Request<Incoming>) -> bool {
        let Some(wanted) = self.token else { return true };
        let shown = request
            .headers()
            .get(AUTHORIZATION)
            .and_then(|value| value.to_str().ok());
        let token = shown.and_then(|text| text.strip_prefix("Bearer "));
        token.is_some_and(|token| <[u8; 32]>::from(Sha256::digest(token.trim())) == wanted)
    }
}

/// A body that is not too long and comes in time; one that says that it is too long is not waited for.
async fn within_limits(body: Incoming) -> Option<Bytes> {
    if body.size_hint().lower() > MAX_BODY as u64 {
        return None;
    }
    let whole = tokio::time::timeout(SILENCE, Limited::new(body, MAX_BODY).collect());
    Some(whole.await.ok()?.ok()?.to_bytes())
}

fn response((status, media_type, body): Answer) -> Response<Full<Bytes>> {
    let mut response = Response::new(Full::new(body));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(media_type));
    response
}
