//! `/metrics`, `/livez` and `/readyz` over plain HTTP, on an address of their own: for whoever looks after the server.
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{ALLOW, CONTENT_TYPE, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::TcpListener;
use tokio::sync::{Mutex, Semaphore, watch};
use tokio::time::{sleep, timeout};

use super::Metrics;
use crate::ledger::{Ledger, LedgerError};
use crate::run::Readiness;
use crate::service::{clock, placement};

/// Connections at a time; more wait.
const CONNECTIONS: usize = 64;
/// How long a connection may say nothing.
const SILENCE: Duration = Duration::from_secs(60);
/// How long the ledger may take to be counted; a scraper waits ten seconds by default.
const COUNT: Duration = Duration::from_secs(5);
/// After an error of the listener, such as too many open files.
const PAUSE: Duration = Duration::from_millis(100);
/// The format of the metrics.
const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";

/// What is answered from.
pub struct Page {
    /// What is measured.
    pub metrics: Arc<Metrics>,
    /// Where jobs are counted.
    pub ledger: Arc<dyn Ledger>,
    /// How the parts of the service are.
    pub readiness: watch::Receiver<Readiness>,
}

/// Answers until it is dropped.
pub async fn serve(listener: TcpListener, page: Page) {
    let page = Arc::new(page);
    // What the ledger says is filled in for one reader at a time.
    let turns = Arc::new(Mutex::new(()));
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        // It is never closed.
        let Ok(place) = places.clone().acquire_owned().await else {
            return;
        };
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                tracing::warn!(%error, "a connection to the metrics could not be taken");
                sleep(PAUSE).await;
                continue;
            }
        };
        let (page, turns) = (page.clone(), turns.clone());
        tokio::spawn(async move {
            let answer = service_fn(move |request| {
                let (page, turns) = (page.clone(), turns.clone());
                async move { Ok::<_, Infallible>(page.answer(&request, &turns).await) }
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

impl Page {
    async fn answer(&self, request: &Request<Incoming>, turns: &Mutex<()>) -> Response<Full<Bytes>> {
        if request.method() != Method::GET && request.method() != Method::HEAD {
            let mut refusal = text(StatusCode::METHOD_NOT_ALLOWED, "only GET\n".into());
            refusal
                .headers_mut()
                .insert(ALLOW, HeaderValue::from_static("GET, HEAD"));
            return refusal;
        }
        match request.uri().path() {
            "/metrics" => {
                let _turn = turns.lock().await;
                self.measured().await
            }
            // It answers, so it lives.
            "/livez" => text(StatusCode::OK, "ok\n".into()),
            "/readyz" => self.ready(request.uri().query().unwrap_or_default()),
            _ => text(StatusCode::NOT_FOUND, "there are /metrics, /livez and /readyz\n".into()),
        }
    }

    async fn measured(&self) -> Response<Full<Bytes>> {
        let now = clock::now();
        let counting = async {
            let tally = self.ledger.tally().await?;
            Ok::<_, LedgerError>((tally, self.ledger.workers_since(placement::seen_since(now)).await?))
        };
        let counted = match timeout(COUNT, counting).await {
            Ok(Ok(counted)) => Some(counted),
            Ok(Err(error)) => {
                tracing::warn!(%error, "jobs could not be counted for the metrics");
                None
            }
            Err(_) => {
                tracing::warn!("the ledger took too long to count jobs for the metrics");
                None
            }
        };
        let (tally, workers) = counted.unzip();
        self.metrics.tally(tally, now);
        self.metrics.workers(workers.as_deref());
        match self.metrics.text() {
            Ok(metrics) => answer(StatusCode::OK, OPEN_METRICS, metrics),
            Err(error) => {
                tracing::error!(%error, "metrics could not be written");
                text(StatusCode::INTERNAL_SERVER_ERROR, "failed\n".into())
            }
        }
    }

    /// As Kubernetes' own servers have it: `?exclude=worker` leaves a part out of the answer, and may be there several
    /// times.
    fn ready(&self, query: &str) -> Response<Full<Bytes>> {
        let excluded: Vec<&str> = query
            .split('&')
            .filter_map(|pair| pair.strip_prefix("exclude="))
            .collect();
        let readiness = self.readiness.borrow().clone();
        let (mut lines, mut ready) = (String::new(), true);
        for (part, well) in readiness.parts() {
            let (mark, word) = match (well, excluded.contains(&part)) {
                (_, true) => ("~", "left out"),
                (true, false) => ("+", "well"),
                (false, false) => ("-", "not well"),
            };
            ready &= mark != "-";
            lines += &format!("[{mark}] {part}: {word}\n");
        }
        let status = if ready {
            StatusCode::OK
        } else {
            StatusCode::SERVICE_UNAVAILABLE
        };
        text(status, lines)
    }
}

fn text(status: StatusCode, body: String) -> Response<Full<Bytes>> {
    answer(status, TEXT, body)
}

fn answer(status: StatusCode, kind: &'static str, body: String) -> Response<Full<Bytes>> {
    let mut answer = Response::new(Full::new(body.into()));
    *answer.status_mut() = status;
    answer
        .headers_mut()
        .insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    answer
}
