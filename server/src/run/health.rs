//! Health: whether the ledger and the artifact store can be read and written, and whether a worker is there. As gRPC has
//! it, a server is `SERVING` while the first two are; a server without workers takes jobs all the same, and one that said
//! otherwise would keep away the workers that it waits for.
use std::sync::Arc;
use std::time::Duration;

use guardsplat_proto::v1::{
    artifact_service_server, job_service_server, key_service_server, registry_service_server, token_service_server,
    worker_service_server,
};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::{Instant, interval, timeout};
use tonic_health::ServingStatus;
use tonic_health::pb::health_server::{Health as HealthApi, HealthServer};
use tonic_health::server::{HealthReporter, health_reporter};

use crate::artifacts::ArtifactStore;
use crate::ledger::Ledger;
use crate::metrics::Metrics;
use crate::service::worker_presence::Alive;

/// How often the ledger is asked, and how long it may take to answer.
pub const EVERY: Duration = Duration::from_secs(5);

/// How often a store that was well is asked: every question is a file written.
const STORE_EVERY: Duration = Duration::from_secs(30);

/// What gRPC's health calls the presence of a worker.
const WORKER: &str = "worker";

/// The server as a whole, and each of its services: one can't do without the ledger more than another.
const SERVICES: [&str; 7] = [
    "",
    artifact_service_server::SERVICE_NAME,
    job_service_server::SERVICE_NAME,
    key_service_server::SERVICE_NAME,
    registry_service_server::SERVICE_NAME,
    token_service_server::SERVICE_NAME,
    worker_service_server::SERVICE_NAME,
];

/// What health depends on.
#[derive(Clone)]
pub struct Watched {
    /// The ledger.
    pub ledger: Arc<dyn Ledger>,
    /// The artifacts.
    pub store: ArtifactStore,
    /// Who is there.
    pub workers: Arc<Alive>,
    /// Where it is told as well.
    pub metrics: Arc<Metrics>,
}

/// How the parts of the service are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Readiness {
    /// The ledger can be read and written.
    pub ledger: bool,
    /// So can the artifact store.
    pub artifacts: bool,
    /// A worker is there.
    pub worker: bool,
    /// The server is not about to end.
    pub staying: bool,
}

impl Readiness {
    /// Each part by its name.
    pub fn parts(&self) -> [(&'static str, bool); 4] {
        [
            ("ledger", self.ledger),
            ("artifacts", self.artifacts),
            (WORKER, self.worker),
            ("staying", self.staying),
        ]
    }

    fn serving(&self) -> bool {
        self.ledger && self.artifacts && self.staying
    }
}

/// What the server says about its health.
pub struct Health {
    reporter: HealthReporter,
    readiness: watch::Sender<Readiness>,
    metrics: Arc<Metrics>,
    checks: JoinHandle<()>,
}

impl Health {
    /// Begins to look after what is watched; the first answer is there when this returns.
    pub async fn start(watched: Watched, every: Duration) -> (Self, HealthServer<impl HealthApi>) {
        let (reporter, service) = health_reporter();
        let metrics = watched.metrics.clone();
        let mut checks = Checks {
            watched,
            every,
            store: None,
        };
        let first = checks.look().await;
        tell(&reporter, None, &first, &metrics).await;
        let readiness = watch::Sender::new(first);
        let (told, says) = (readiness.clone(), reporter.clone());
        let checks = tokio::spawn(async move {
            let mut ticks = interval(every);
            loop {
                ticks.tick().await;
                let now = checks.look().await;
                let before = told.send_replace(now.clone());
                tell(&says, Some(&before), &now, &checks.watched.metrics).await;
            }
        });
        let health = Self {
            reporter,
            readiness,
            metrics,
            checks,
        };
        (health, service)
    }

    /// How the parts are, now and later.
    pub fn readiness(&self) -> watch::Receiver<Readiness> {
        self.readiness.subscribe()
    }

    /// Says `NOT_SERVING` from here on.
    pub async fn not_serving(&mut self) {
        self.checks.abort();
        // Over for certain, so that it can't say otherwise afterwards. That it was cut off is no error.
        let _ = (&mut self.checks).await;
        let before = self.readiness.borrow().clone();
        let now = Readiness {
            staying: false,
            ..before.clone()
        };
        self.readiness.send_replace(now.clone());
        tell(&self.reporter, None, &now, &self.metrics).await;
    }

    /// Ends the streams of those who watch, which would keep their connections open.
    pub async fn end(mut self) {
        for service in SERVICES.into_iter().chain([WORKER]) {
            self.reporter.clear_service_status(service).await;
        }
    }
}

/// Looks after the parts.
struct Checks {
    watched: Watched,
    every: Duration,
    /// When the store was last found well.
    store: Option<Instant>,
}

impl Checks {
    async fn look(&mut self) -> Readiness {
        let limit = self.every;
        let ledger = well("the ledger", limit, self.watched.ledger.check()).await;
        if self.store.is_none_or(|at| at.elapsed() >= STORE_EVERY) {
            let found = well("the artifact store", limit, self.watched.store.probe()).await;
            self.store = found.then(Instant::now);
        }
        Readiness {
            ledger,
            artifacts: self.store.is_some(),
            worker: self.watched.workers.alive(),
            staying: true,
        }
    }
}

async fn well<E: std::error::Error>(what: &str, limit: Duration, check: impl Future<Output = Result<(), E>>) -> bool {
    match timeout(limit, check).await {
        Ok(Ok(())) => true,
        Ok(Err(error)) => {
            tracing::error!(%error, "{what} is not well");
            false
        }
        Err(_) => {
            tracing::error!("{what} does not answer");
            false
        }
    }
}

/// Tells gRPC's health what has changed, and metrics how it is.
async fn tell(reporter: &HealthReporter, before: Option<&Readiness>, now: &Readiness, metrics: &Metrics) {
    for (part, well) in now.parts() {
        metrics.ready(part, well);
    }
    if before.is_none_or(|before| before.serving() != now.serving()) {
        set(reporter, now.serving()).await;
    }
    let worker = |readiness: &Readiness| readiness.worker && readiness.staying;
    if before.is_none_or(|before| worker(before) != worker(now)) {
        reporter.set_service_status(WORKER, status(worker(now))).await;
    }
}

fn status(well: bool) -> ServingStatus {
    match well {
        true => ServingStatus::Serving,
        false => ServingStatus::NotServing,
    }
}

async fn set(reporter: &HealthReporter, serving: bool) {
    for service in SERVICES {
        reporter.set_service_status(service, status(serving)).await;
    }
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;
    use tonic::Request;
    use tonic_health::pb::HealthCheckRequest;
    use tonic_health::server::HealthService;

    use super::*;
    use crate::ledger::SqliteLedger;

    const EVERY: Duration = Duration::from_millis(200);

    async fn says(health: &Health, service: &str) -> bool {
        let answers = HealthService::from_health_reporter(health.reporter.clone());
        let request = HealthCheckRequest {
            service: service.into(),
        };
        let answer = answers.check(Request::new(request)).await.unwrap().into_inner();
        answer.status() == tonic_health::pb::health_check_response::ServingStatus::Serving
    }

    async fn watched(folder: &TempDir) -> Watched {
        let ledger = SqliteLedger::open(&folder.path().join("ledger.sqlite")).await.unwrap();
        Watched {
            ledger: Arc::new(ledger),
            store: ArtifactStore::open(&folder.path().join("artifacts"), 1 << 20).unwrap(),
            workers: Arc::default(),
            metrics: Arc::default(),
        }
    }

    /// Waits until a service is told to be as it should.
    async fn becomes(health: &Health, service: &str, serving: bool) {
        for _ in 0..50 {
            if says(health, service).await == serving {
                return;
            }
            tokio::time::sleep(EVERY).await;
        }
        panic!("{service:?} never became {serving}");
    }

    #[tokio::test]
    async fn follows_the_ledger() {
        let folder = TempDir::new().unwrap();
        let watched = watched(&folder).await;
        let jobs = job_service_server::SERVICE_NAME;
        let (health, _service) = Health::start(watched.clone(), EVERY).await;
        assert!(says(&health, jobs).await);
        watched.ledger.close().await;
        let (ill, _service) = Health::start(watched, EVERY).await;
        assert!(!says(&ill, jobs).await, "from the beginning");
        becomes(&health, jobs, false).await;
    }

    #[tokio::test]
    async fn follows_the_store() {
        let folder = TempDir::new().unwrap();
        let watched = watched(&folder).await;
        // Nothing of a trial is left.
        watched.store.probe().await.unwrap();
        let store = folder.path().join("artifacts");
        assert_eq!(std::fs::read_dir(&store).unwrap().count(), 0);
        // A folder that is a file takes nothing, whoever asks.
        std::fs::remove_dir(&store).unwrap();
        std::fs::write(&store, "").unwrap();
        let (health, _service) = Health::start(watched, EVERY).await;
        assert!(!says(&health, "").await);
        let now = health.readiness().borrow().clone();
        assert!(now.ledger && !now.artifacts && now.staying);
        std::fs::remove_file(&store).unwrap();
        std::fs::create_dir(&store).unwrap();
        becomes(&health, "", true).await;
    }

    #[tokio::test]
    async fn a_server_without_workers_serves_and_says_so() {
        let folder = TempDir::new().unwrap();
        let watched = watched(&folder).await;
        let (mut health, _service) = Health::start(watched.clone(), EVERY).await;
        assert!(says(&health, "").await && !says(&health, WORKER).await);
        watched.workers.heard();
        becomes(&health, WORKER, true).await;
        assert!(health.readiness().borrow().worker);
        health.not_serving().await;
        assert!(!says(&health, "").await && !says(&health, WORKER).await);
        assert!(!health.readiness().borrow().staying);
    }
}
