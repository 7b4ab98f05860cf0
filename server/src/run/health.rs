//! Health as gRPC has it: `SERVING` only while the ledger can be read and written.
use std::sync::Arc;
use std::time::Duration;

use guardsplat_proto::v1::{
    artifact_service_server, job_service_server, key_service_server, registry_service_server, token_service_server,
    worker_service_server,
};
use tokio::task::JoinHandle;
use tokio::time::{interval, timeout};
use tonic_health::ServingStatus;
use tonic_health::pb::health_server::{Health as HealthApi, HealthServer};
use tonic_health::server::{HealthReporter, health_reporter};

use crate::ledger::Ledger;

/// How often the ledger is asked, and how long it may take to answer.
pub const EVERY: Duration = Duration::from_secs(5);

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

/// What the server says about its health.
pub struct Health {
    reporter: HealthReporter,
    checks: JoinHandle<()>,
}

impl Health {
    /// Begins to look after the ledger; the first answer is there when this returns.
    pub async fn start(ledger: Arc<dyn Ledger>, every: Duration) -> (Self, HealthServer<impl HealthApi>) {
        let (reporter, service) = health_reporter();
        let mut serving = check(&*ledger, every).await;
        set(&reporter, serving).await;
        let statuses = reporter.clone();
        let checks = tokio::spawn(async move {
            let mut ticks = interval(every);
            loop {
                ticks.tick().await;
                let now = check(&*ledger, every).await;
                if now != serving {
                    serving = now;
                    set(&statuses, serving).await;
                }
            }
        });
        (Self { reporter, checks }, service)
    }

    /// Says `NOT_SERVING` from here on.
    pub async fn not_serving(&mut self) {
        self.checks.abort();
        // Over for certain, so that it can't say otherwise afterwards. That it was cut off is no error.
        let _ = (&mut self.checks).await;
        set(&self.reporter, false).await;
    }

    /// Ends the streams of those who watch, which would keep their connections open.
    pub async fn end(mut self) {
        for service in SERVICES {
            self.reporter.clear_service_status(service).await;
        }
    }
}

async fn check(ledger: &dyn Ledger, limit: Duration) -> bool {
    match timeout(limit, ledger.check()).await {
        Ok(Ok(())) => true,
        Ok(Err(error)) => {
            tracing::error!(%error, "the ledger is not well");
            false
        }
        Err(_) => {
            tracing::error!("the ledger does not answer");
            false
        }
    }
}

async fn set(reporter: &HealthReporter, serving: bool) {
    let status = if serving {
        ServingStatus::Serving
    } else {
        ServingStatus::NotServing
    };
    for service in SERVICES {
        reporter.set_service_status(service, status).await;
    }
}

#[cfg(test)]
mod tests {
    use tonic::Request;
    use tonic_health::pb::HealthCheckRequest;
    use tonic_health::server::HealthService;

    use super::*;
    use crate::ledger::SqliteLedger;

    async fn says(health: &Health) -> ServingStatus {
        let service = HealthService::from_health_reporter(health.reporter.clone());
        let request = HealthCheckRequest {
            service: job_service_server::SERVICE_NAME.into(),
        };
        let status = service
            .check(Request::new(request))
            .await
            .unwrap()
            .into_inner()
            .status();
        if status == tonic_health::pb::health_check_response::ServingStatus::Serving {
            ServingStatus::Serving
        } else {
            ServingStatus::NotServing
        }
    }

    #[tokio::test]
    async fn follows_the_ledger() {
        let folder = tempfile::TempDir::new().unwrap();
        let ledger = Arc::new(SqliteLedger::open(&folder.path().join("ledger.sqlite")).await.unwrap());
        let every = Duration::from_millis(200);
        let (health, _service) = Health::start(ledger.clone(), every).await;
        assert_eq!(says(&health).await, ServingStatus::Serving);
        ledger.close().await;
        let (ill, _service) = Health::start(ledger, every).await;
        assert_eq!(says(&ill).await, ServingStatus::NotServing, "from the beginning");
        for _ in 0..50 {
            if says(&health).await == ServingStatus::NotServing {
                return;
            }
            tokio::time::sleep(every).await;
        }
        panic!("still serving without a ledger");
    }
}
