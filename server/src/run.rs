//! The server as a whole: opens what it keeps, answers calls, looks after its worker, and stops in good order.
mod files;
mod folder;
mod health;
pub(crate) mod ledger;
pub(crate) mod store;

use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use futures::FutureExt as _;
use health::{Health, Watched};
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::{Instant, timeout, timeout_at};

use crate::access;
use crate::artifacts::ArtifactStore;
use crate::embedded::{Backoff, EmbeddedWorker, WorkerProcess};
use crate::error::{Error, Result};
use crate::grpc::guard::Guard;
use crate::grpc::listener::{self, ConnectionLimits, ListenerOptions, Protocol};
use crate::hooks::{Poster, Rules};
use crate::ledger::Ledger;
use crate::metrics::{self, Page};
use crate::notary::Notary;
use crate::secrets;
use crate::service::rate_limit::Rates;
use crate::service::retention::RetentionPolicy;
use crate::service::{Limits, Service, clock, seeds};
use crate::settings::{Access, Settings};
use crate::tasks::{deliveries, housekeeping, remote_changes};
use crate::tls;
use crate::traces::Traces;
pub(crate) use folder::DataFolder;
pub use health::Readiness;

/// Calls that have begun get at least so long to end, even if the worker took all the time there was.
const LEAST_DRAIN: Duration = Duration::from_secs(1);

/// Connections of the own worker, which has a listener to itself. Others on this machine may try.
const SIDE: ConnectionLimits = ConnectionLimits {
    total: 32,
    of_one_address: 32,
};

/// Runs a server until `shutdown`. Says on standard output where it listens, once it does.
pub async fn serve(settings: Settings, shutdown: impl Future<Output = ()>) -> Result<()> {
    let mut shutdown = pin!(shutdown);
    // A database that is waited for must not keep the process from ending.
    let server = tokio::select! {
        server = Server::open(settings) => server?,
        () = &mut shutdown => return Ok(()),
    };
    // Nobody may be reading, which is no reason to stop.
    let scheme = if server.door.tls.is_some() { "https" } else { "http" };
    let _ = writeln!(std::io::stdout(), "listening on {scheme}://{}", server.address());
    server.run(shutdown).await
}

/// A server that listens, and does not answer yet.
pub struct Server {
    settings: Settings,
    listener: TcpListener,
    address: SocketAddr,
    worker: Option<WorkerProcess>,
    door: ListenerOptions,
    /// Where the own worker comes in while the door for all others speaks TLS.
    side: Option<(TcpListener, Guard)>,
    /// Where browsers come in.
    page: Option<(TcpListener, ListenerOptions)>,
    /// Where metrics are to be had.
    metrics: Option<TcpListener>,
    ledger: Arc<dyn Ledger>,
    store: ArtifactStore,
    api: Service,
    poster: Poster,
    /// Held until the end, so that no other server uses the folder.
    _folder: DataFolder,
}

impl Server {
    /// Opens the data folder, the master key, the store, the ledger and the listener.
    pub async fn open(settings: Settings) -> Result<Self> {
        let files = files::raise();
        let folder = DataFolder::open(&settings.data_dir)?;
        let master = secrets::load(settings.key_source(), folder.path()).map_err(startup)?;
        let store = store::open(&settings, folder.path()).await?;
        let ledger = ledger::open(&settings, folder.path()).await.map_err(startup)?;
        let listener = TcpListener::bind(settings.listen)
            .await
            .map_err(|error| Error::Startup(format!("listening on {}: {error}", settings.listen)))?;
        let address = listener.local_addr().map_err(startup)?;
        let notary = Notary::open(ledger.as_ref(), &master, clock::now())
            .await
            .map_err(startup)?;
        seeds::seal_all(ledger.as_ref(), &master).await.map_err(startup)?;
        store::claim(&store, &notary, &*ledger, clock::now()).await?;
        let traces = Traces::from_environment()?;
        let api = Service::new(ledger.clone(), store.clone(), master, notary, limits(&settings)).traced(traces);
        let poster = poster(&settings)?;
        let tls = tls::load(&settings)?;
        let mut worker = None;
        let mut side = None;
        let mut own_token = None;
        if settings.embedded_worker {
            // Good for as long as this process lives, and kept nowhere.
            let own = access::fresh()?;
            let mut reached = address;
            if tls.is_some() {
                // The certificate is made out to a name that others know, which the worker need not: it has a listener of
                // its own that nobody else on this machine gets past either.
                let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.map_err(startup)?;
                reached = listener.local_addr().map_err(startup)?;
                side = Some((listener, Guard::own_worker(api.meter(), own.hash)));
            }
            let mut process = WorkerProcess::new(&settings, reached)?;
            if tls.is_some() || settings.access == Access::Tokens {
                own_token = Some(own.hash);
                process.token = Some(own.text);
            }
            worker = Some(process);
        }
        let guard = match settings.access {
            Access::Open => Guard::open(api.meter()),
            Access::Tokens => Guard::tokens(api.meter(), ledger.clone(), own_token),
        };
        let door = ListenerOptions {
            guard,
            tls,
            protocol: Protocol::Grpc,
            connections: files::connections(&settings, files),
            handshake: listener::HANDSHAKE,
            idle: settings.connection_idle(),
            api: api.clone(),
        };
        let page = match settings.page_listen {
            Some(wanted) => Some(listen_for_browsers(wanted, &door).await?),
            None => None,
        };
        let metrics = match settings.metrics_listen {
            Some(wanted) => Some(listen_for_metrics(wanted).await?),
            None => None,
        };
        tracing::info!(data_dir = %folder.path().display(), %address, "opened");
        Ok(Self {
            settings,
            listener,
            address,
            worker,
            door,
            side,
            page,
            metrics,
            ledger,
            store,
            api,
            poster,
            _folder: folder,
        })
    }

    /// Where it listens; with the port that it got, if any would do.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers calls until `shutdown`, then stops: says so to whoever asks for its health, takes no more work, has the
    /// worker hand back what it has, lets calls end, and closes the ledger.
    pub async fn run(self, shutdown: impl Future<Output = ()>) -> Result<()> {
        let watched = Watched {
            ledger: self.ledger.clone(),
            store: self.store,
            workers: self.api.workers(),
            metrics: self.api.metrics(),
        };
        let (mut health, health_service) = Health::start(watched, health::EVERY).await;
        // To the end: who looks after the server wants to see it stop.
        let measured = self.metrics.map(|listener| {
            let page = Page {
                metrics: self.api.metrics(),
                ledger: self.ledger.clone(),
                readiness: health.readiness(),
            };
            tokio::spawn(metrics::serve(listener, page))
        });
        let routes = self.api.routes()?.add_service(health_service);
        let (drain, drained) = oneshot::channel();
        // A sender that is gone says the same.
        let drained = drained.map(|_| ()).shared();
        let side = self.side.map(|(listener, guard)| {
            let door = ListenerOptions {
                guard,
                tls: None,
                protocol: Protocol::Grpc,
                connections: SIDE,
                handshake: listener::HANDSHAKE,
                idle: None,
                api: self.api.clone(),
            };
            tokio::spawn(listener::serve(routes.clone(), door, listener, drained.clone()))
        });
        let browsers = self
            .page
            .map(|(listener, door)| tokio::spawn(listener::serve(routes.clone(), door, listener, drained.clone())));
        let mut calls = tokio::spawn(listener::serve(routes, self.door, self.listener, drained));
        let housekeeping = tokio::spawn(housekeeping::housekeeping(self.api.clone()));
        let deliveries = tokio::spawn(deliveries::deliveries(self.api.clone(), self.poster));
        // It ends with the API.
        tokio::spawn(remote_changes::relay(self.api.clone()));
        let worker = self
            .worker
            .map(|worker| EmbeddedWorker::start(worker, Backoff::default()));

        let broken = tokio::select! {
            () = shutdown => None,
            ended = &mut calls => Some(ended),
        };
        tracing::info!("stopping");
        let limit = Instant::now() + self.settings.stop_limit();
        health.not_serving().await;
        self.api.stop();
        if let Some(worker) = worker {
            worker.stop(self.settings.stop_limit()).await;
        }
        health.end().await;
        let ended = match broken {
            Some(ended) => Some(ended),
            None => {
                let _ = drain.send(());
                let limit = limit.max(Instant::now() + LEAST_DRAIN);
                if let Some(side) = side {
                    // Its one caller has ended before.
                    drain_until(side, limit).await;
                }
                if let Some(browsers) = browsers {
                    drain_until(browsers, limit).await;
                }
                drain_until(calls, limit).await
            }
        };
        if let Some(measured) = measured {
            measured.abort();
        }
        self.api.traces().close().await;
        if timeout(LEAST_DRAIN, housekeeping).await.is_err() {
            tracing::warn!("housekeeping is cut off");
        }
        if timeout(LEAST_DRAIN, deliveries).await.is_err() {
            tracing::warn!("what hooks are to be told is cut off");
        }
        if timeout(LEAST_DRAIN, self.ledger.close()).await.is_err() {
            tracing::warn!("the ledger is cut off; what it acknowledged is on disk all the same");
        }
        tracing::info!("stopped");
        match ended {
            Some(ended) => ended.map_err(|error| Error::internal("answering calls", error))?,
            None => Ok(()),
        }
    }
}

/// Listens for browsers, and says where. They come in by the guard, and in the numbers, of all others.
async fn listen_for_browsers(wanted: SocketAddr, door: &ListenerOptions) -> Result<(TcpListener, ListenerOptions)> {
    let failed = |error| Error::Startup(format!("listening for browsers on {wanted}: {error}"));
    let listener = TcpListener::bind(wanted).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let scheme = if door.tls.is_some() { "https" } else { "http" };
    tracing::info!(%address, "the page is at {scheme}://{address}/");
    let door = ListenerOptions {
        guard: door.guard.clone(),
        tls: door.tls.as_deref().map(tls::for_page),
        protocol: Protocol::Page,
        connections: door.connections,
        handshake: door.handshake,
        idle: door.idle,
        api: door.api.clone(),
    };
    Ok((listener, door))
}

/// Listens where metrics are asked for, and says where, as any port may have been wanted.
async fn listen_for_metrics(wanted: SocketAddr) -> Result<TcpListener> {
    let failed = |error| Error::Startup(format!("listening for metrics on {wanted}: {error}"));
    let listener = TcpListener::bind(wanted).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    tracing::info!(%address, "metrics are at http://{address}/metrics");
    Ok(listener)
}

type Calls = JoinHandle<Result<()>>;

/// Waits for calls to end, and cuts them off when the time is over.
async fn drain_until(mut calls: Calls, limit: Instant) -> Option<Result<Result<()>, tokio::task::JoinError>> {
    let ended = timeout_at(limit, &mut calls).await;
    if ended.is_err() {
        tracing::warn!("calls that did not end are cut off");
        calls.abort();
    }
    ended.ok()
}

fn limits(settings: &Settings) -> Limits {
    Limits {
        lease: settings.lease(),
        // Its limit is far below.
        max_attempts: i32::try_from(settings.max_attempts).unwrap_or(i32::MAX),
        max_queued: settings.max_queued_jobs,
        max_priority: settings.max_priority,
        max_job_memory: settings.max_job_memory(),
        max_job_gigapixels: settings.max_job_gigapixels,
        progress_stall: Duration::from_secs(settings.progress_stall_seconds),
        upload_idle: settings.upload_timeout(),
        watch_stall: settings.watch_stall(),
        max_watches: settings.max_watches_per_caller,
        download_stall: settings.download_stall(),
        max_transfers: settings.max_transfers_per_caller,
        false_positive_rate: settings.false_positive_rate,
        raw_verification: settings.allow_raw_verification,
        max_queued_of_project: Some(settings.max_queued_jobs_per_project).filter(|&limit| limit > 0),
        // Without tokens there is one project, whose the whole queue is.
        fair_shares: settings.access == Access::Tokens,
        max_bytes_of_project: Some(settings.max_artifact_bytes_per_project).filter(|&limit| limit > 0),
        rates: Rates {
            submissions: settings.max_submissions_per_minute,
            claims: settings.max_claims_per_minute,
            calls: settings.max_calls_per_minute,
        },
        abandoned_after: settings.abandoned_after(),
        hooks: rules(settings),
        signed_url: Some(Duration::from_secs(settings.signed_url_seconds)).filter(|time| !time.is_zero()),
        retention: RetentionPolicy {
            uploads: days(settings.keep_uploads_days),
            outputs: days(settings.keep_outputs_days),
            jobs: days(settings.keep_jobs_days),
        },
    }
}

fn rules(settings: &Settings) -> Rules {
    Rules {
        allow_http: settings.hook_allow_http,
        allow_private: settings.hook_allow_private,
        give_up_after: Duration::from_secs(settings.hook_give_up_seconds),
    }
}

/// What sends messages to hooks.
fn poster(settings: &Settings) -> Result<Poster> {
    let told = |path: &Path, reason: String| Error::Startup(format!("hook_ca {}: {reason}", path.display()));
    let ca = match &settings.hook_ca {
        Some(path) => Some(std::fs::read(path).map_err(|error| told(path, error.to_string()))?),
        None => None,
    };
    let place = settings.hook_ca.as_deref().unwrap_or(Path::new(""));
    Poster::new(rules(settings), ca.as_deref()).map_err(|reason| told(place, reason))
}

/// Days as the ledger counts time; 0 is for ever.
fn days(days: u64) -> Option<Duration> {
    Some(Duration::from_secs(days * 24 * 60 * 60)).filter(|time| !time.is_zero())
}

/// Why the server can't start, with all causes that are not part of the text before.
pub(crate) fn startup(error: impl std::error::Error) -> Error {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    Error::Startup(text)
}
