//! The conformance suite against a real server, and what is PostgreSQL's own.
mod away;
#[path = "../../../../tests/support/postgres.rs"]
pub(crate) mod cluster;
mod several;
mod tables;

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use secrecy::SecretString;
use sqlx::{Connection, PgConnection};
use tokio::sync::{Mutex, OnceCell};

use super::super::conformance::{Factory, conformance_suite, model, speed};
use super::super::{Ledger, PostgresLedger};
use super::open;
use cluster::Cluster;

/// A database with the ledger's tables that is copied for each test.
const TEMPLATE: &str = "ledger";

/// A database of one test.
pub(crate) struct Place {
    cluster: &'static Cluster,
    name: String,
}

impl Place {
    /// One with empty tables; none where PostgreSQL is not installed.
    pub(crate) async fn fresh() -> Option<Self> {
        static TEMPLATE_MADE: OnceCell<()> = OnceCell::const_new();
        let cluster = Cluster::shared()?;
        TEMPLATE_MADE
            .get_or_init(async || {
                cluster.create(TEMPLATE, None);
                let template = Self {
                    cluster,
                    name: TEMPLATE.into(),
                };
                template.ledger().await.close().await;
                // The listener's connection may take a moment to go, and nobody may use what is copied.
                std::mem::forget(template.without_users().await);
            })
            .await;
        Some(Self::made(cluster, Some(TEMPLATE)))
    }

    /// One without tables.
    pub(crate) async fn empty() -> Option<Self> {
        Some(Self::made(Cluster::shared()?, None))
    }

    fn made(cluster: &'static Cluster, template: Option<&str>) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("test{}", COUNT.fetch_add(1, Ordering::Relaxed));
        cluster.create(&name, template);
        Self { cluster, name }
    }

    pub(crate) fn url(&self) -> SecretString {
        self.cluster.url(&self.name).into()
    }

    pub(crate) async fn ledger(&self) -> Arc<PostgresLedger> {
        Arc::new(PostgresLedger::open(&self.url()).await.expect("the ledger opens"))
    }

    /// A connection for what a person with a shell might do.
    pub(super) async fn raw(&self) -> PgConnection {
        let options = open::options(&self.url()).expect("a URL");
        PgConnection::connect_with(&options).await.expect("a connection")
    }

    /// Ends all connections to the database but one that this requirements.
    pub(super) async fn end_connections(&self) -> i64 {
        let mut db = self.raw().await;
        let ended = sqlx::query_scalar(
            "SELECT count(pg_terminate_backend(pid, 5000)) FROM pg_stat_activity \
             WHERE datname = current_database() AND pid <> pg_backend_pid()",
        );
        let ended = ended.fetch_one(&mut db).await.expect("connections are ended");
        db.close().await.expect("a connection is closed");
        ended
    }

    async fn without_users(self) -> Self {
        self.end_connections().await;
        self
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.cluster.remove(&self.name);
        }
    }
}

#[async_trait::async_trait]
impl Factory for Place {
    async fn open(&self) -> Arc<dyn Ledger> {
        self.ledger().await
    }

    async fn open_several(&self, count: usize) -> Vec<Arc<dyn Ledger>> {
        let mut all: Vec<Arc<dyn Ledger>> = Vec::new();
        for _ in 0..count {
            all.push(self.open().await);
        }
        all
    }
}

conformance_suite!(Place::fresh().await);

/// Run with `-- --ignored --nocapture`; the figures depend on the disk.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "a measurement"]
async fn claims_of_a_long_queue() {
    for projects in speed::PROJECTS {
        if let Some(place) = Place::fresh().await {
            speed::claims_of_a_long_queue("postgresql", &place, projects).await;
        }
    }
}

#[test]
fn random_work_agrees_with_the_model() {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .expect("a runtime");
    let Some(place) = runtime.block_on(Place::fresh()) else {
        return;
    };
    let (ledger, db) = runtime.block_on(async { (place.ledger().await, Mutex::new(place.raw().await)) });
    let config = ProptestConfig {
        cases: 48,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let outcome = TestRunner::new(config).run(&model::steps(), |steps| {
        runtime.block_on(async {
            // A new database for each case would take longer than the case.
            let mut db = db.lock().await;
            sqlx::query("DELETE FROM jobs")
                .execute(&mut *db)
                .await
                .expect("jobs are deleted");
            model::agrees(ledger.clone(), steps).await;
        });
        Ok(())
    });
    outcome.expect("ledger and model agree");
    // Connections belong to the runtime, and end before it.
    drop((ledger, db));
}
