//! The conformance suite against a real file, and what is SQLite's own.
mod file;
mod speed;
mod writing;

use std::path::PathBuf;
use std::sync::Arc;

use proptest::prelude::*;
use sqlx::sqlite::SqliteSynchronous;
use tempfile::TempDir;

use super::super::conformance::{Factory, conformance_suite, model};
use super::super::{Ledger, SqliteLedger};
use super::open;

/// A folder with a ledger in it.
pub(super) struct Folder(TempDir);

impl Folder {
    pub(super) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub(super) fn path(&self) -> PathBuf {
        self.0.path().join("ledger.sqlite")
    }

    pub(super) async fn ledger(&self) -> Arc<SqliteLedger> {
        Arc::new(SqliteLedger::open(&self.path()).await.expect("the ledger opens"))
    }
}

#[async_trait::async_trait]
impl Factory for Folder {
    async fn open(&self) -> Arc<dyn Ledger> {
        self.ledger().await
    }
}

conformance_suite!(Some(Folder::new()));

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_work_agrees_with_the_model(steps in model::steps()) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        runtime.block_on(async {
            let folder = Folder::new();
            // Only what is in the rows matters here, not the disk.
            let options = open::options(&folder.path()).synchronous(SqliteSynchronous::Off);
            let ledger = Arc::new(SqliteLedger::open_with(options).await.expect("the ledger opens"));
            model::agrees(ledger, steps).await;
        });
    }
}
