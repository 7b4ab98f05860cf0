//! The ledger in a SQLite file: one writer that commits in groups, readers beside it (WAL).
//!
//! What PostgreSQL does just so is in [`shared`](super::shared).
#![allow(
    clippy::duplicate_mod,
    reason = "files of `shared` are a part of each database's module"
)]

/// Locks nothing, as there is one writer. So do the next three.
macro_rules! for_update {
    () => {
        ""
    };
}
macro_rules! for_share {
    () => {
        ""
    };
}
macro_rules! for_key_share {
    () => {
        ""
    };
}
macro_rules! skip_locked {
    ($($table:literal)?) => {
        ""
    };
}
/// Names an index to the planner, which would choose another.
macro_rules! indexed_by {
    ($index:literal) => {
        concat!(" INDEXED BY ", $index)
    };
}
/// The larger of two values.
macro_rules! greatest {
    ($a:literal, $b:literal) => {
        concat!("max(", $a, ", ", $b, ")")
    };
}
/// The sum of bytes of a selection, of which there may be none. It is one of floating point, which does not overflow.
macro_rules! total {
    ($value:literal) => {
        concat!("CAST(total(", $value, ") AS INTEGER)")
    };
}
/// A join that reads its left side in order.
macro_rules! in_order_join {
    () => {
        " CROSS JOIN "
    };
}

pub mod copy;
mod deliveries;
mod inputs;
mod open;
mod presence;
mod queue;
mod retention;
#[cfg(test)]
mod tests;
mod writer;

#[path = "../shared/artifacts.rs"]
mod artifacts;
#[path = "../shared/commitments.rs"]
mod commitments;
#[path = "../shared/credentials.rs"]
mod credentials;
#[path = "../shared/generation.rs"]
mod generation;
#[path = "../shared/history.rs"]
mod history;
#[path = "../shared/hooks.rs"]
mod hooks;
#[path = "../shared/jobs.rs"]
mod jobs;
#[path = "../shared/keys.rs"]
mod keys;
#[path = "../shared/leases.rs"]
mod leases;
#[path = "../shared/registry.rs"]
mod registry;
#[path = "../shared/reservations.rs"]
mod reservations;
#[path = "../shared/retries.rs"]
mod retries;
#[path = "../shared/rows.rs"]
mod rows;
#[path = "../shared/statistics.rs"]
mod statistics;
#[path = "../shared/tokens.rs"]
mod tokens;
#[path = "../shared/transition.rs"]
mod transition;
#[path = "../shared/workers.rs"]
mod workers;

use std::path::Path;

use futures::future::BoxFuture;
use sqlx::SqlitePool;
use tokio::sync::broadcast;

use super::{JobQueue as _, Ledger, LedgerError, RemoteChange, Result};
use writer::Writer;

/// What [`shared`](super::shared) means by these.
type DbConnection = sqlx::SqliteConnection;
type DbLedger = SqliteLedger;
type DbRow = sqlx::sqlite::SqliteRow;

/// Begins a transaction that sees one moment.
const SNAPSHOT: &str = "BEGIN";

/// A text as the database can keep it: any.
fn storable(text: &str) -> String {
    text.to_owned()
}

/// A ledger in one SQLite file.
pub struct SqliteLedger {
    readers: SqlitePool,
    writer: Writer,
}

impl SqliteLedger {
    /// Opens the ledger in `path`, making or updating it as needed.
    ///
    /// # Errors
    /// `Database` when the file can't be opened or is no database, `Migrate` when a newer version wrote it.
    pub async fn open(path: &Path) -> Result<Self> {
        Self::open_with(open::options(path)).await
    }

    async fn open_with(options: sqlx::sqlite::SqliteConnectOptions) -> Result<Self> {
        let first = open::migrated(&options).await?;
        let readers = open::readers(&options);
        Ok(Self {
            readers,
            writer: Writer::start(options, first),
        })
    }

    /// Reads.
    async fn read<T, F>(&self, work: F) -> Result<T>
    where
        F: for<'c> FnOnce(&'c mut DbConnection) -> BoxFuture<'c, Result<T>>,
    {
        work(&mut *self.readers.acquire().await?).await
    }

    /// Makes a change, durable when this returns.
    async fn change<T, F>(&self, work: F) -> Result<T>
    where
        T: Send + 'static,
        F: for<'c> FnOnce(&'c mut DbConnection) -> BoxFuture<'c, Result<T>> + Send + 'static,
    {
        self.writer.run(work).await
    }
}

#[async_trait::async_trait]
impl Ledger for SqliteLedger {
    async fn check(&self) -> Result<()> {
        self.queue_depth().await?;
        // An empty transaction of the writer takes the write lock, and writes nothing.
        self.writer.run(|_| Box::pin(async { Ok::<_, LedgerError>(()) })).await
    }

    fn is_shared(&self) -> bool {
        false
    }

    fn remote_changes(&self) -> Option<broadcast::Receiver<RemoteChange>> {
        None
    }

    async fn close(&self) {
        self.writer.close().await;
        self.readers.close().await;
    }
}
